"""Untrusted inputs cannot run code: run folders, states, databases, indices and all kinds of names."""

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.fake_tracker import FakeTracker, write_recording
from tests.run_helpers import run as run_command
from tests.run_helpers import write_people, write_run
from toolkit.app.pipeline import run as pipeline
from toolkit.app.pipeline import track_recording
from toolkit.body import skeleton
from toolkit.io.archives import CHECKSUM, checksum_of
from toolkit.io.errors import DepthMocapError, RecordingError, TrackError
from toolkit.io.files import sha256_of
from toolkit.recordings.opening import open_recording
from toolkit.tracks import RunInfo
from toolkit.tracks.runs import load_people

KEY = "-----BEGIN PRIVATE KEY-----"
WRITTEN = (".lock", ".lock-owner", "track.partial", "log.txt", "manifest.jsonl")
READ = ("run.json", "config.yaml", "track.npz", "state.npz", "people.json")


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording and a run interrupted in the middle, with its state."""
    folder = tmp_path_factory.mktemp("stopped")
    recording = write_recording(folder / "take.npz")
    memory, pipeline.MEMORY_SECONDS = pipeline.MEMORY_SECONDS, -1.0
    try:
        with pytest.raises(RecordingError, match="frame 6"):
            track_recording(open_recording(recording), FakeTracker(broken=6), folder / "run")
    finally:
        pipeline.MEMORY_SECONDS = memory
    return folder


@pytest.fixture
def begun(stopped: Path, tmp_path: Path) -> Path:
    """Return a copy of the run that can be resumed."""
    shutil.copytree(stopped / "run", tmp_path / "run")
    return tmp_path / "run"


def go_on(stopped: Path, run: Path) -> np.ndarray:
    track_recording(open_recording(stopped / "take.npz"), FakeTracker(), run, resume=True)
    with np.load(run / "track.npz") as arrays:
        return np.array(arrays["joints"])


@pytest.mark.parametrize("name", [*WRITTEN[:4], *READ])
@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_no_link_in_a_run_folder_is_written_or_read_through(
    stopped: Path, begun: Path, tmp_path: Path, name: str, link: Callable[[Path, Path], None]
) -> None:
    thesis = tmp_path / "thesis.txt"
    thesis.write_text(KEY)
    (begun / name).unlink(missing_ok=True)
    link(begun / name, thesis)
    try:
        go_on(stopped, begun)
    except DepthMocapError as error:
        assert KEY not in str(error)
    assert thesis.read_text() == KEY


def test_a_page_never_shows_what_a_link_leads_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "id_rsa").write_text(KEY)
    run = write_run(tmp_path / "run", np.zeros((3, skeleton.POSE_SIZE)))
    (run / "config.yaml").symlink_to(tmp_path / "id_rsa")
    run_command("report", str(run), "--output", str(tmp_path / "page.html"))
    assert KEY not in (tmp_path / "page.html").read_text() and KEY not in "".join(capsys.readouterr())


@pytest.mark.parametrize("there", ["track.npz", "config.yaml", "people.json", "person_01/track.npz", "state.npz"])
def test_what_is_there_and_is_not_this_runs_is_refused(stopped: Path, tmp_path: Path, there: str) -> None:
    mine = tmp_path / "run" / there
    mine.parent.mkdir(parents=True)
    mine.write_bytes(b"mine")
    for resume in (False, True):
        with pytest.raises(TrackError, match="no run.json, so its run is unknown"):
            track_recording(open_recording(stopped / "take.npz"), FakeTracker(), tmp_path / "run", resume=resume)
    assert mine.read_bytes() == b"mine"


def test_a_run_of_people_whose_folders_are_links_is_refused(tmp_path: Path) -> None:
    run = write_people(tmp_path / "run", np.zeros((3, skeleton.POSE_SIZE)))
    (run / "person_02").rename(tmp_path / "elsewhere")
    (run / "person_02").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(TrackError, match="is a link"):
        load_people(run)


STATES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "another shape": lambda value: np.zeros((2, 2), value.dtype),
    "text": lambda value: np.full(value.shape, "x"),
    "endless": lambda value: np.full(value.shape, np.nan),
    "a row less": lambda value: value[:-1],
}


@pytest.mark.parametrize("change", STATES)
def test_a_state_of_other_contents_under_a_right_checksum_is_one_sentence(
    stopped: Path, begun: Path, change: str
) -> None:
    with np.load(begun / "state.npz") as stored:
        arrays = dict(stored)
    del arrays[CHECKSUM]
    fewer_times = {"state/timestamps"} if change == "a row less" else set()  # a state of an earlier frame
    for name in sorted(set(arrays) - {"header"} - fewer_times):
        odd = {**arrays, name: STATES[change](arrays[name])}
        np.savez(begun / "state.npz", **odd, **{CHECKSUM: np.array(checksum_of(odd))})
        with pytest.raises(TrackError, match="the state|of another recording"):
            go_on(stopped, begun)


def test_a_recording_of_links_that_lead_out_of_it_is_refused(tmp_path: Path) -> None:
    from toolkit.recordings.opening import open_recording

    (tmp_path / "take").mkdir()
    (tmp_path / "secret.png").write_text(KEY)
    (tmp_path / "take" / "0.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(RecordingError, match="a link that leads out"):
        open_recording(tmp_path / "take")


def test_a_recording_without_measurements_is_reported(tmp_path: Path) -> None:
    path = write_recording(tmp_path / "take.npz", 3)
    with np.load(path) as arrays:
        values = {name: arrays[name] for name in arrays.files if name != CHECKSUM}
    np.savez(path, **{**values, "depth": np.full_like(values["depth"], 65535)})
    with pytest.raises(RecordingError, match="no frame of take holds a measurement"):
        track_recording(open_recording(path), FakeTracker(), tmp_path / "run")


NAMES = (b"[/red].npz", b"$\\foo$.npz", b"a\nb.npz", b"\x1b[31mred.npz", b"caf\xe9.npz", b"=1+1.npz")


@pytest.mark.parametrize("name", NAMES)
def test_names_of_files_do_nothing(
    name: bytes, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recording = write_recording(Path(os.fsdecode(name)), 3)
    run = write_run(tmp_path / os.fsdecode(name.removesuffix(b".npz")), np.zeros((3, skeleton.POSE_SIZE)))
    info = RunInfo.load(run)
    replace(info, recording=str(recording.resolve()), recording_sha256=sha256_of(recording)).save(run)
    for words in (
        ("evaluate", str(run), "--output", "tables"),
        ("report", str(run), "--output", "page.html"),
        ("render", str(run), "--output", "sheet.png"),
        ("export", str(run), "--output", "motion.csv"),
    ):
        code = run_command(*words)
        said = b"".join(capfdbinary.readouterr())
        assert code in (0, 1, 2) and b"Traceback" not in said and b"\x1b[31m" not in said, words
    table = tmp_path / "tables"
    assert not [line for path in table.glob("*.csv") for line in path.read_text().splitlines() if line.startswith("=")]


def test_a_word_without_end_in_a_cloud_is_one_sentence(tmp_path: Path) -> None:
    from toolkit.recordings.readers.cloud import load_cloud

    header = (
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    for text in (header.replace("vertex", "[" * 2000), header + "0 0 " + "1" * 2000):
        (tmp_path / "a.ply").write_text(text)
        with pytest.raises(RecordingError, match="a word of more than"):
            load_cloud(tmp_path / "a.ply", "camera")
