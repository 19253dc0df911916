"""Fit the weights of the person score: `python -m training.fit_person_score HELD.npz`.

HELD.npz holds images of `training.room_images` that were not trained on. Each candidate of the package's network is a
true head if a head lies within `ASIDE` and `ALONG` of it. A logistic regression of the candidate's peak and of the mean
log-odds of its pixels gives the weights of `toolkit.people.evidence.person_score`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from toolkit.people.detection import find_heads, peak_and_odds
from toolkit.people.view import CoarseCamera
from toolkit.sensing.camera import DEFAULT_UP, Camera
from toolkit.sensing.sensing_settings import SensingSettings
from training.room_images import FOCAL, HEIGHT, WIDTH

ASIDE, ALONG = 0.2, 0.4
"""Metres between a candidate, which lies on the surface, and the centre of a head: in the image plane, in depth."""
LEAST = -3.0
"""Least log-odds of a candidate's peak."""


def candidates(depths: np.ndarray, heads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return peak and mean log-odds (N, 2) of the candidates of all images, and which of them are heads, bool (N,).

    Parameters
    ----------
    depths : uint16 (K, 120, 160), millimetres
    heads : float32 (K, 8, 3), metres, camera frame, 0 without a person
    """
    camera = Camera(FOCAL, FOCAL, 0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1), WIDTH, HEIGHT)
    coarse = CoarseCamera(camera, np.array(DEFAULT_UP), SensingSettings(), WIDTH)
    rows, truth = [], []
    for depth_mm, places in zip(depths, heads, strict=True):
        depth = coarse.downsampled(depth_mm)
        view = coarse.view(depth, depth > 0, np.zeros(depth.shape, dtype=np.bool_))
        for head in find_heads(view, coarse, LEAST):
            rows.append(peak_and_odds(view, coarse, head.place))
            away = np.abs(places[places[:, 2] > 0] - coarse.from_level(head.place[None]))
            truth.append(bool(((np.hypot(away[:, 0], away[:, 1]) < ASIDE) & (away[:, 2] < ALONG)).any()))
    return np.array(rows, dtype=np.float64).reshape(-1, 2), np.array(truth, dtype=np.bool_)


def main() -> None:
    """Fit and print the weights."""
    from sklearn.linear_model import LogisticRegression

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("held", type=Path)
    stored = np.load(parser.parse_args().held)
    rows, truth = candidates(stored["depth"], stored["heads"])
    fitted = LogisticRegression(C=1e3).fit(rows, truth)
    (peak, odds), offset = fitted.coef_[0], fitted.intercept_[0]
    print(f"{len(rows)} candidates, {truth.mean():.0%} heads: peak {peak:.2f}, odds {odds:.2f}, offset {offset:.2f}")


if __name__ == "__main__":
    main()
