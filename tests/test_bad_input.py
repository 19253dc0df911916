"""Each verb with each kind of bad input: exit code 1 or 2 and one sentence, no output, no waiting."""

import io
import os
import pickle
import zipfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.database_helpers import small_database
from tests.fake_tracker import write_recording
from tests.run_helpers import write_run
from tests.sample_files import classes_file
from toolkit.app.cli.main import main
from toolkit.body import skeleton
from toolkit.io.files import sha256_of
from toolkit.tracks import RunInfo

VERBS: dict[str, tuple[str, ...]] = {
    "database info": ("database", "info", "BAD"),
    "database build": ("database", "build", "BAD", "--output", "OUT.npz"),
    "info": ("info", "BAD"),
    "simulate": ("simulate", "BAD", "--output", "OUT.npz"),
    "joints": ("joints", "BAD", "--output", "OUT.npz"),
    "track": ("track", "BAD", "--database", "POSES", "--output", "OUT"),
    "track, database": ("track", "TAKE", "--database", "BAD", "--output", "OUT"),
    "track, settings": ("track", "TAKE", "--database", "POSES", "--config", "BAD", "--output", "OUT"),
    "track, body": ("track", "TAKE", "--database", "POSES", "--body", "BAD", "--output", "OUT"),
    "track, joints": ("track", "TAKE", "--database", "POSES", "--joints", "BAD", "--output", "OUT"),
    "track, classes": ("track", "TAKE", "--database", "POSES", "--classes", "BAD", "--events", "-", "--output", "OUT"),
    "track, queries": ("track", "TAKE", "--database", "POSES", "--queries", "BAD", "--output", "OUT"),
    "track, background": ("track", "TAKE", "--database", "POSES", "--background", "BAD", "--output", "OUT"),
    "track, workers": ("track", "BAD", "--database", "POSES", "--output", "OUT", "--workers", "1"),
    "evaluate": ("evaluate", "BAD"),
    "render": ("render", "BAD", "--output", "OUT.png"),
    "report": ("report", "BAD", "--output", "OUT.html"),
    "export": ("export", "BAD", "--output", "OUT.csv"),
    "index": ("index", "BAD", "--output", "OUT.index"),
    "search": ("search", "BAD", "--by-example", "POSES"),
    "learn": ("learn", "BAD", "--output", "OUT.json"),
    "annotate": ("annotate", "BAD", "--classes", "POSES", "--output", "OUT"),
    "annotate, classes": ("annotate", "POSES", "--classes", "BAD", "--output", "OUT"),
    "inertial read": ("inertial", "read", "BAD", "--output", "OUT.npz"),
    "inertial calibrate": ("inertial", "calibrate", "BAD", "--sensors", "BAD", "--output", "OUT"),
    "stabilise": ("stabilise", "BAD", "--classes", "POSES", "--output", "OUT"),
    "stabilise, classes": ("stabilise", "RUN", "--classes", "BAD", "--output", "OUT"),
    "body scan": ("body", "scan", "BAD", "--output", "OUT.npz"),
    "export, rig": ("export", "RUN", "--rig", "BAD", "--output", "OUT.glb"),
}


def _npz_of(header: str, data: bytes = b"") -> bytes:
    """Return an NPZ file of one array with any header."""
    text = header.encode() + b"\n"
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("depth.npy", b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data)
    return out.getvalue()


@cache
def bomb() -> bytes:
    """Return an array of 64 MB in a small file."""
    return _npz_of("{'descr': '|u1', 'fortran_order': False, 'shape': (67108864,), }", bytes(1 << 26))


PICKLE = _npz_of("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", pickle.dumps([{}]))
KINDS: dict[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "empty": lambda path: path.write_bytes(b""),
    "noise": lambda path: path.write_bytes(bytes(range(256)) * 8),
    "an empty folder": lambda path: path.mkdir(),
    "a pipe": lambda path: os.mkfifo(path),
    "a link to a device": lambda path: path.symlink_to("/dev/zero"),
    "a bomb": lambda path: path.write_bytes(bomb()),
    "a pickle": lambda path: path.write_bytes(PICKLE),
}
NAMES = ("bad.npz", "x" * 300)


@pytest.mark.parametrize("verb", VERBS)
def test_bad_input_is_one_sentence(verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses, take, run = (tmp_path / name for name in ("poses.npz", "take.npz", "run"))
    small_database(12).save(poses)
    write_run(run, np.zeros((3, skeleton.POSE_SIZE)), recording=str(write_recording(take, 3)))
    for name in NAMES:
        for kind, make in KINDS.items():
            if len(name) > 255 and kind != "missing":
                continue
            if (verb, kind) == ("track, settings", "empty"):
                continue  # typical values
            folder = tmp_path / f"{name[:8]} {kind}"
            folder.mkdir()
            make(folder / name)
            before = sorted(folder.rglob("*"))
            words = {"BAD": str(folder / name), "POSES": str(poses), "TAKE": str(take), "RUN": str(run)}
            arguments = [words.get(a, str(folder / a) if a.startswith("OUT") else a) for a in VERBS[verb]]
            with pytest.raises(SystemExit) as stop:
                main(arguments)
            said = capsys.readouterr().err
            assert stop.value.code in (1, 2), f"{kind}: exit code {stop.value.code}"
            assert "Traceback" not in said and "Error:" not in said, f"{kind}: {said}"
            assert stop.value.code == 2 or said.splitlines()[-1].startswith("depthmocap: "), f"{kind}: {said}"
            written = set(folder.rglob("*")) - set(before)
            assert not [p for p in written if p.is_file() and p.suffix not in (".jsonl",)], f"{kind}: {written}"


OVERWRITES: dict[str, tuple[str, ...]] = {
    "database build": ("database", "build", "READ.npz", "--output", "READ.npz"),
    "body scan": ("body", "scan", "READ.npz", "--output", "READ.npz"),
    "simulate": ("simulate", "READ.npz", "--output", "READ.npz"),
    "joints": ("joints", "READ.npz", "--output", "READ.npz"),
    "track": ("track", "READ.npz", "--database", "POSES", "--output", "READ.npz"),
    "evaluate": ("evaluate", "RUN", "--reference", "table.csv", "--output", "."),
    "render": ("render", "RUN", "--output", "RUN"),
    "report": ("report", "RUN", "--output", "RUN"),
    "export": ("export", "RUN", "--output", "RUN"),
    "index": ("index", "RUN", "--output", "RUN"),
    "search": ("search", "READ.npz", "--by-example", "table.csv", "--output", "table.csv"),
    "learn": ("learn", "RUN", "--output", "RUN"),
    "stabilise": ("stabilise", "RUN", "--classes", "READ.npz", "--output", "RUN"),
    "inertial read": ("inertial", "read", "READ.npz", "--output", "READ.npz"),
    "inertial calibrate": ("inertial", "calibrate", "RUN", "--sensors", "READ.npz", "--output", "READ.npz"),
}


@pytest.mark.parametrize("verb", OVERWRITES)
def test_nothing_is_written_over_what_is_read(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    small_database(12).save("poses.npz")
    for name in ("READ.npz", "table.csv"):
        Path(name).write_bytes(b"mine")
    Path("RUN").mkdir()
    Path("RUN/track.npz").write_bytes(b"mine")
    with pytest.raises(SystemExit) as stop:
        main([{"POSES": "poses.npz"}.get(word, word) for word in OVERWRITES[verb]])
    assert stop.value.code in (1, 2) and "Traceback" not in capsys.readouterr().err
    for name in ("READ.npz", "table.csv", "RUN/track.npz"):
        assert Path(name).read_bytes() == b"mine"


OUT_OF_RANGE: dict[str, str] = {
    "demo --output table.csv": "choose another folder",
    "render run --output f.webm --rate inf": "frames a second",
    "render run --output f.webm --rate nan": "frames a second",
    "track take.npz --database poses.npz --output o --depth-unit 0": "--depth-unit is '0'",
    "track take.npz --database poses.npz --output o --set seed=-1": "seed is -1",
    "track take.npz --config swarm --output o --set seed=-1": "seed is -1",
    "track take.npz --config lopez2011 --output o --set seed=-1": "seed is -1",
    "learn run --labels labels.csv --output m.npz": "field larger than",
    "annotate run --classes classes.npz --truth segments.csv --output o": "segments.csv",
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording, its run, a database, classes and impossible tables."""
    folder = tmp_path_factory.mktemp("files")
    small_database(12).save(folder / "poses.npz")
    write_recording(folder / "take.npz")
    write_run(folder / "run", np.zeros((40, skeleton.POSE_SIZE)), recording=str(folder / "take.npz"))
    info = RunInfo.load(folder / "run")
    replace(info, recording_sha256=sha256_of(folder / "take.npz")).save(folder / "run")
    classes_file(folder).rename(folder / "classes.npz")
    (folder / "table.csv").write_bytes(b"mine")
    (folder / "labels.csv").write_text("clip,label\nrun," + "x" * 140_000 + "\n")
    (folder / "segments.csv").write_text("start,end,label\n0,inf,walk\n")
    return folder


@pytest.mark.parametrize("command", OUT_OF_RANGE)
def test_what_cannot_be_is_named(
    command: str, files: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(files)
    with pytest.raises(SystemExit) as stop:
        main(command.split())
    said = capsys.readouterr().err.splitlines()[-1]
    assert stop.value.code in (1, 2) and said.startswith("depthmocap: ") and OUT_OF_RANGE[command] in said
    assert (files / "table.csv").read_bytes() == b"mine"


@pytest.mark.parametrize("command", ["report run --output r.html --to", "render run --output f.png --from"])
def test_a_frame_that_no_recording_has_is_named(
    command: str, files: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(files)
    with pytest.raises(SystemExit) as stop:
        main([*command.split(), "9" * 40])
    said = capsys.readouterr().err
    assert stop.value.code == 2 and command.split()[-1] in said and "Traceback" not in said
