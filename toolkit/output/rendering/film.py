"""Off-screen rendering of a run as a film, a contact sheet or single pictures."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from toolkit.io.errors import OutputError, UsageError
from toolkit.io.files import atomic_path, check_output, save_bytes
from toolkit.io.progress import Count, silent
from toolkit.output.rendering import style
from toolkit.output.rendering.encoders import FILM_SUFFIXES, open_encoder
from toolkit.output.rendering.painter import FramePainter, RenderSettings
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracks import RUN_FILE, TRACK_FILE, RunInfo
from toolkit.tracks.runs import Person, load_persons, person_runs


def settings_for(output: str | Path) -> RenderSettings:
    """Return the default paint settings by suffix: the pictures of a contact sheet are small."""
    return RenderSettings(height=300, aspect=0.9) if Path(output).suffix == ".png" else RenderSettings()


def write_film(path: str | Path, rate: float, pictures: Iterator[np.ndarray]) -> None:
    """Write pictures to a film file; a failed film leaves no file under the final name.

    Parameters
    ----------
    path : the suffix, one of `encoders.FILM_SUFFIXES`, selects the codec
    rate : frames per second
    pictures : uint8 (H, W, 3), RGB, of equal size; an odd last row or column is cropped

    Raises
    ------
    UsageError
        The suffix is unknown, or needs a package that is not installed.
    OutputError
        The file cannot be written.
    """
    target = Path(path)
    if target.suffix not in FILM_SUFFIXES:
        raise UsageError(f"{path} is no film; name it {' or '.join('*' + suffix for suffix in FILM_SUFFIXES)}")
    with atomic_path(target, lasting=False) as place, _plainly_named(place) as temporary:
        encoder = None
        try:
            for picture in pictures:
                even = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
                if encoder is None:
                    encoder = open_encoder(temporary, target.suffix, rate, *even.shape[1::-1])
                encoder.write(even)
        finally:
            if encoder is not None:
                encoder.close()
        if encoder is None or temporary.stat().st_size == 0:
            raise OutputError(f"nothing was written to {target}; check the space left on its disk")


@contextmanager
def _plainly_named(path: Path) -> Iterator[Path]:
    """Return a path for the encoders: `path`, or a temporary one if it is not ASCII."""
    if str(path).isascii():
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / f"film{path.suffix}"
        yield plain
        shutil.copyfile(plain, path)


def render_people(
    people: Sequence[Person],
    recording: Recording,
    output: str | Path,
    *,
    sensing: SensingSettings | None = None,
    settings: RenderSettings | None = None,
    frames: range | None = None,
    rate: float | None = None,
    progress: Count = silent,
) -> Path:
    """Draw tracks: a film for .mp4, .webm and .avi, a contact sheet for .png, or one PNG per frame into a folder.

    Parameters
    ----------
    people, recording, sensing, settings : see `FramePainter`
    output : the file; a name without suffix is a folder
    frames : indices of the frames; default: all
    rate : frame rate of the film; default: that of the recording
    progress : called after every frame

    Raises
    ------
    TrackError
        A track does not belong to the recording.
    UsageError
        The suffix of the output or the rate is invalid, the output would damage the recording, or there are no frames.
    OutputError
        The output cannot be written.
    """
    target = check_output(output, [recording.path], sealed=[recording.path])
    largest_rate = 240.0  # maximum frame rate of players and codecs, Hz
    if rate is not None and not 0 < rate <= largest_rate:
        raise UsageError(f"a film cannot have {rate:g} frames a second; choose a rate above 0 and up to {largest_rate}")
    if target.suffix and target.suffix not in (".png", *FILM_SUFFIXES):
        films = ", ".join(f"*{suffix}" for suffix in FILM_SUFFIXES)
        raise UsageError(f"cannot draw to {target}; name it {films}, *.png or a folder")
    painter = FramePainter(people, recording, sensing=sensing, settings=settings or settings_for(target))
    chosen = range(len(recording)) if frames is None else frames
    if not len(chosen) or chosen.start < 0 or max(chosen) >= len(recording):
        raise UsageError(f"frames {chosen} are not some of the {len(recording)} frames of the track")
    if target.suffix == ".png":
        sheet_frames = 12  # pictures of a contact sheet
        wanted = [chosen[k] for k in np.linspace(0, len(chosen) - 1, min(sheet_frames, len(chosen))).astype(int)]
        save_png(target, contact_sheet(list(_pictures(painter, recording, wanted, progress))))
    elif target.suffix in FILM_SUFFIXES:
        pictures = _pictures(painter, recording, chosen, progress)
        write_film(target, rate or _rate(recording.timestamps), pictures)
    else:
        for i, picture in zip(chosen, _pictures(painter, recording, chosen, progress), strict=True):
            save_png(target / f"{i:05d}.png", picture)
    return target


def render_run(
    run: str | Path,
    output: str | Path,
    *,
    recording: str | Path | None = None,
    settings: RenderSettings | None = None,
    frames: range | slice | None = None,
    rate: float | None = None,
    progress: Count = silent,
) -> Path:
    """Draw all people of a run folder; recording, bodies and sensing settings come from `run.json`.

    `recording` is the new location of a moved recording, `frames` may be a slice. The other arguments are those of
    `render_people`.

    Raises
    ------
    UsageError
        No person was found in the run; other errors as `render_people`.
    """
    people, folders = load_persons(run), person_runs(run)
    check_output(output, [folder / name for folder in (*folders, Path(run)) for name in (TRACK_FILE, RUN_FILE)])
    info = RunInfo.load(folders[0])
    opened = info.open_recording(recording)
    if isinstance(frames, slice):
        frames = range(frames.start or 0, len(opened) if frames.stop is None else frames.stop)
    return render_people(
        people,
        opened,
        output,
        sensing=SensingSettings(**info.sensing),
        settings=settings,
        frames=frames,
        rate=rate,
        progress=progress,
    )


def contact_sheet(pictures: list[np.ndarray], columns: int = 2) -> np.ndarray:
    """Arrange pictures, RGB uint8 (H, W, 3) of equal size, in rows of one RGB picture."""
    if not pictures:
        raise UsageError("a contact sheet needs at least one picture")
    columns = min(columns, len(pictures))
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // columns)
    gap = 6  # gap between pictures, pixels
    sheet = np.full((rows * (height + gap) - gap, columns * (width + gap) - gap, 3), style.PAPER, dtype=np.uint8)
    for k, picture in enumerate(pictures):
        v, u = (k // columns) * (height + gap), (k % columns) * (width + gap)
        sheet[v : v + height, u : u + width] = picture
    return sheet


def save_png(path: str | Path, picture: np.ndarray) -> None:
    """Write an RGB picture as PNG, atomically."""
    import cv2

    # OpenCV ends the process for a name that is no UTF-8; therefore it only encodes, and Python writes.
    save_bytes(path, cv2.imencode(".png", np.ascontiguousarray(picture[:, :, ::-1]))[1].tobytes())


def _pictures(
    painter: FramePainter, recording: Recording, wanted: range | list[int], progress: Count
) -> Iterator[np.ndarray]:
    """Yield the pictures of the selected frames in order."""
    chosen, last, done = set(wanted), max(wanted), 0
    for i, depth in enumerate(recording.frames()):
        if i in chosen:
            yield painter.paint(i, depth)
            done += 1
            progress(done, len(chosen))
        if i == last:
            return


def _rate(timestamps: np.ndarray) -> float:
    steps = np.diff(timestamps)
    usual = float(np.median(steps)) if len(steps) else 0.0
    default_rate = 25.0  # default frame rate for recordings with invalid timestamps, Hz
    return float(np.clip(1 / usual, 1, 120)) if usual > 0 else default_rate
