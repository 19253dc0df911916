"""What a trained joint regressor's numbers are worth: probabilities, learnt on views that it was not trained on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from database_builder.room_views import SHELL, RoomPainter, RoomView
from database_builder.views import FOCAL, CroppedView, ViewSettings, draw_view, is_seated
from toolkit.body import skeleton
from toolkit.body.shape import ShapeSpace
from toolkit.io.progress import Count
from toolkit.kernels.learning import forest as kernels
from toolkit.landmarks.regressor import JointRegressor

CLOSE = 0.1
"""Metres from the true joint within which an estimate counts as right."""
SAMPLES = 500
"""Points that vote, as in the tracker."""
KNOTS = 26
"""Confidences at which the reliability is kept."""
DECIMALS = 2
"""Of log odds: the others differ with the processor's linear algebra."""
FEWEST = 60
"""Pixels without which no person is looked for."""


def calibrated(
    trained: JointRegressor, poses: np.ndarray, settings: ViewSettings, views: int, rng: np.random.Generator,
    progress: Count,
) -> JointRegressor:  # fmt: skip
    """The forest with the calibration that `views` new views of canonical `poses` (N, P) give it."""
    space = ShapeSpace.load()
    sits = is_seated(poses, space.body())
    found: list[tuple[np.ndarray, ...]] = []
    for view in range(views):
        progress(view, views)
        drawn = draw_view(poses, sits, space, settings, rng)
        if (observed := _votes(trained, drawn)) is not None:
            joints, confidence, evidence = observed
            close = np.linalg.norm(joints - drawn.joints, axis=1) < CLOSE
            found.append((confidence, close, evidence, drawn.in_view))
    progress(views, views)
    if not found:
        return trained
    confidence, close, evidence, in_view = (np.array(column) for column in zip(*found, strict=True))
    rows = range(len(skeleton.REPORTED))
    person_odds = trained.person_odds
    if settings.rooms:
        person_odds = _person_odds(trained, RoomPainter(poses, sits, settings), views, rng)
    return replace(
        trained,
        person_odds=person_odds,
        calibration=np.array([_rising(confidence[:, j], close[:, j]) for j in rows], dtype=np.float32),
        in_view_odds=np.array([_odds(evidence[:, j], in_view[:, j]) for j in rows], dtype=np.float32),
    )


def _person_odds(trained: JointRegressor, painter: RoomPainter, views: int, rng: np.random.Generator) -> np.ndarray:
    """Log odds of a pixel's being of a person as a line in those of its leaves, float32 (2,), at even odds."""
    found, of_person = [], []
    for _ in range(views):
        view = painter.draw(rng)
        kinds = (view.owner < SHELL, view.owner == SHELL, view.owner > SHELL)
        for kind, count in zip(kinds, (100, 50, 50), strict=True):
            pixels = np.flatnonzero(kind & (view.depth > 0) & (view.depth < kernels.UNOBSERVED))
            pixels = rng.choice(pixels, min(count, len(pixels)), replace=False)
            probability = room_probability(trained, view, pixels)
            found.append(np.log(probability / (1.0 - probability)))
            of_person.append(np.full(len(pixels), kind is kinds[0]))
    odds, truth = np.concatenate(found), np.concatenate(of_person)
    if truth.all() or not truth.any():
        return np.array([0.0, 1.0], dtype=np.float32)
    return np.array(_odds(odds, truth, "balanced"), dtype=np.float32)


def room_probability(trained: JointRegressor, view: RoomView, pixels: np.ndarray) -> np.ndarray:
    """`JointRegressor.person_probability` (N,) of some pixels of a drawn room."""
    image = np.where(view.depth == kernels.UNOBSERVED, np.float32(-1.0), view.depth * np.float32(0.001))
    camera = np.array([FOCAL, FOCAL, *-view.corner])
    return trained.person_probability(image, camera, np.diag([1.0, -1.0, -1.0]), pixels)


def _votes(trained: JointRegressor, view: CroppedView) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Votes of a drawn view in the image that it was cut from; None where hardly anything of the person is left."""
    first_u, last_u, first_v, last_v = view.window
    image = np.zeros((last_v - first_v + 1, last_u - first_u + 1), dtype=np.float32)
    u0, v0 = max(first_u, 0), max(first_v, 0)
    inside = view.depth[v0 : last_v + 1, u0 : last_u + 1]
    metres = np.where(inside == kernels.UNOBSERVED, np.float32(-1.0), inside * np.float32(0.001))
    image[v0 - first_v : v0 - first_v + len(inside), u0 - first_u : u0 - first_u + inside.shape[1]] = metres
    pixels = np.flatnonzero(image > 0)
    if len(pixels) < FEWEST:
        return None
    pixels = pixels[np.linspace(0, len(pixels) - 1, min(SAMPLES, len(pixels))).astype(np.int64)]
    v, u = np.divmod(pixels, image.shape[1])
    z = image[v, u].astype(np.float64)
    centre = -(view.corner + [first_u, first_v])
    points = np.stack([(u - centre[0]) * z / FOCAL, -(v - centre[1]) * z / FOCAL, -z], axis=1)
    return trained.votes(image, np.array([FOCAL, FOCAL, *centre]), np.diag([1.0, -1.0, -1.0]), pixels, points)


def _rising(confidence: np.ndarray, close: np.ndarray) -> np.ndarray:
    """Share of the estimates that are right at `KNOTS` confidences from 0 to 1, rising: (KNOTS,)."""
    from sklearn.isotonic import IsotonicRegression

    fitted = IsotonicRegression(y_min=0.0, y_max=1.0, out_of_bounds="clip").fit(confidence, close)
    return np.asarray(fitted.predict(np.linspace(0.0, 1.0, KNOTS)))


def _odds(evidence: np.ndarray, in_view: np.ndarray, weight: str | None = None) -> tuple[float, float]:
    """Log odds of being in view as a line in the evidence; "balanced": were it as likely as not beforehand."""
    from sklearn.linear_model import LogisticRegression

    if in_view.all() or not in_view.any():
        return (4.0 if in_view.all() else -4.0), 0.0
    fitted = LogisticRegression(C=10.0, class_weight=weight).fit(evidence[:, None], in_view)
    return round(float(fitted.intercept_[0]), DECIMALS), round(float(fitted.coef_[0, 0]), DECIMALS)
