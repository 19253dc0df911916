"""Data sets by name: registry, download from a server on this machine, and the command."""

import hashlib
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import NamedTuple

import pytest

from toolkit.app.cli.main import main
from toolkit.datasets import registry
from toolkit.datasets.fetch import fetch_data_set
from toolkit.datasets.registry import DATA_SETS, DataSet, digest_of
from toolkit.io.errors import DataError, OutputError, UsageError

FILES = {"depth/a b.png": b"\x89PNG first", "take.bvh": b"HIERARCHY\r\nMOTION\r\n", "LICENSE": b"MIT"}


class Server(NamedTuple):
    """Server of files: contents by address, requested addresses, and faults."""

    contents: dict[str, bytes]
    requested: list[str]
    faults: dict[str, str]


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    """Serve `FILES` of one data set on the loopback interface in the place of GitHub."""
    state = Server({f"/owner/name/0123/src/{path}".replace(" ", "%20"): data for path, data in FILES.items()}, [], {})

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            state.requested.append(self.path)
            data, fault = state.contents.get(self.path), state.faults.get(self.path)
            if data is None or fault == "error page":
                self.send_response(404 if data is None else 503)
                self.end_headers()
                self.wfile.write(b"<html>not here</html>")
                return
            self.send_response(200)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            sent = {"half": data[: len(data) // 2], "other": b"x" * len(data)}.get(fault or "", data)
            self.wfile.write(sent)

        def log_message(self, format: str, *args: object) -> None:
            pass

    served = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=served.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    monkeypatch.setattr(registry, "GITHUB", f"http://127.0.0.1:{served.server_port}/{{repository}}/{{commit}}/")
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    yield state
    served.shutdown()
    thread.join()
    served.server_close()


@pytest.fixture
def data_set(tmp_path: Path) -> DataSet:
    """Return a data set of the files that `server` has."""
    rows = []
    for path, data in FILES.items():
        digest = hashlib.sha256(data.replace(b"\r\n", b"\n") if path.endswith(".bvh") else data).hexdigest()
        rows.append(f"{digest}\t{len(data)}\t{path}\tsrc/{path}")
    (tmp_path / "lists").mkdir()
    (tmp_path / "lists" / "small.tsv").write_text("\n".join(rows) + "\n")
    return DataSet(
        "small", "sets/small", "three files", "MIT", "Somebody 2020", "https://example.org/small", (),
        "owner/name", "0123", assets=tmp_path / "lists",
    )  # fmt: skip


def test_a_fetched_data_set_has_its_files_and_is_not_fetched_twice(
    server: Server, data_set: DataSet, tmp_path: Path
) -> None:
    steps: list[tuple[str, int, int]] = []
    place = fetch_data_set(data_set, tmp_path / "data", progress=lambda *step: steps.append(step))
    assert {path: (place / path).read_bytes() for path in FILES} == FILES
    assert steps == [("fetching small", done, 3) for done in (1, 2, 3)] and len(server.requested) == 3
    assert fetch_data_set(data_set, tmp_path / "data") == place and len(server.requested) == 3


def test_files_that_are_there_are_left_alone_whatever_their_line_ends(
    server: Server, data_set: DataSet, tmp_path: Path
) -> None:
    clip = tmp_path / "sets" / "small" / "take.bvh"
    clip.parent.mkdir(parents=True)
    clip.write_bytes(FILES["take.bvh"].replace(b"\r\n", b"\n"))
    fetch_data_set(data_set, tmp_path)
    assert len(server.requested) == 2 and b"\r" not in clip.read_bytes()


@pytest.mark.parametrize(
    ("fault", "message"), [("half", "broke off"), ("other", "another file"), ("error page", "503 Server Error")]
)
def test_a_bad_answer_is_not_kept_and_the_next_fetch_goes_on(
    server: Server, data_set: DataSet, tmp_path: Path, fault: str, message: str
) -> None:
    server.faults["/owner/name/0123/src/take.bvh"] = fault
    with pytest.raises(DataError, match=message) as raised:
        fetch_data_set(data_set, tmp_path)
    assert "depthmocap data fetch small" in str(raised.value)
    there = {path.name for path in (tmp_path / "sets").rglob("*") if path.is_file()}
    assert there == {"a b.png"}, "neither half a file nor a temporary one"
    server.faults.clear()
    before = len(server.requested)
    fetch_data_set(data_set, tmp_path)
    assert len(server.requested) == before + 2 and not data_set.missing(tmp_path)


def test_without_a_network_the_error_names_the_cause(
    server: Server, data_set: DataSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "GITHUB", "http://127.0.0.1:9/{repository}/{commit}/")
    with pytest.raises(DataError, match="check the network"):
        fetch_data_set(data_set, tmp_path)


def test_another_file_of_that_name_is_never_replaced(server: Server, data_set: DataSet, tmp_path: Path) -> None:
    mine = tmp_path / "sets" / "small" / "LICENSE"
    mine.parent.mkdir(parents=True)
    mine.write_text("my own")
    with pytest.raises(DataError, match="move it away"):
        fetch_data_set(data_set, tmp_path)
    assert mine.read_text() == "my own" and not server.requested


def test_a_folder_that_cannot_be_written_is_refused_and_used_where_all_is_there(
    server: Server, data_set: DataSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    for root in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(OutputError):
            fetch_data_set(data_set, root)

    def read_only(*args: object, **options: object) -> None:
        raise PermissionError(13, "Permission denied")

    fetch_data_set(data_set, tmp_path / "full")
    monkeypatch.setattr(Path, "mkdir", read_only)
    fetch_data_set(data_set, tmp_path / "full")
    with pytest.raises(OutputError, match="Permission denied"):
        fetch_data_set(data_set, tmp_path / "empty")


def test_two_fetches_at_once_download_each_file_once(server: Server, data_set: DataSet, tmp_path: Path) -> None:
    errors: list[BaseException] = []

    def run() -> None:
        try:
            fetch_data_set(data_set, tmp_path)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors and sorted(server.requested) == sorted(server.contents)
    assert not data_set.missing(tmp_path)


def test_a_data_set_without_an_address_has_instructions(data_set: DataSet, tmp_path: Path) -> None:
    by_hand = replace(data_set, repository=None, commit=None, licence="no copies", steps="Ask the authors.")
    with pytest.raises(DataError, match=r"no copies.*Ask the authors.*example\.org/small"):
        fetch_data_set(by_hand, tmp_path)
    assert not (tmp_path / "sets").exists()


def test_the_command_lists_fetches_and_finds(
    server: Server,
    data_set: DataSet,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(DATA_SETS, "small", data_set)
    monkeypatch.setenv("DEPTHMOCAP_DATA", str(tmp_path / "not there yet"))

    def run(*words: str) -> tuple[int, str]:
        code = 0
        try:
            main(["data", *words])
        except SystemExit as stopped:
            code = int(stopped.code or 0)
        read = capsys.readouterr()
        return code, read.out + read.err

    assert run("where") == (0, f"{tmp_path / 'not there yet'}\n")
    code, text = run("where", "small")
    assert code == 1 and "depthmocap data fetch small" in text
    assert "0 of 3" in next(line for line in run("list")[1].splitlines() if line.startswith("│ small "))
    code, text = run("fetch", "small")
    assert code == 0 and "Somebody 2020" in text
    assert run("where", "small") == (0, f"{tmp_path / 'not there yet' / 'sets' / 'small'}\n")
    assert "0 missing" in run("list", "small")[1]
    code, text = run("fetch", "small", "smal")
    assert code == 2 and "there is no data set 'smal'" in text
    assert run("where", "small", "--data", str(tmp_path / "other"))[0] == 1


@pytest.mark.parametrize("name", DATA_SETS)
def test_every_entry_of_the_registry_is_complete(name: str) -> None:
    entry = DATA_SETS[name]
    assert entry.licence and entry.citation and entry.about and entry.files
    assert (entry.source is None) == bool(entry.steps), "either an address or what to do"
    assert entry.commit is None or len(entry.commit) == 40
    paths = [file.path for file in entry.files]
    assert len(set(paths)) == len(paths)
    for file in entry.files:
        assert len(file.sha256) == 64 and file.size > 0 and not Path(file.path).is_absolute() and ".." not in file.path
        assert (file.url is None) == (entry.source is None)


def test_no_two_data_sets_disagree_on_a_file() -> None:
    digests: dict[str, str] = {}
    for entry in DATA_SETS.values():
        for file in entry.files:
            assert digests.setdefault(file.path, file.sha256) == file.sha256


@pytest.mark.data(*DATA_SETS)
def test_the_data_folder_matches_the_registry(data_folder: Path) -> None:
    for entry in DATA_SETS.values():
        assert not entry.missing(data_folder), entry.name


def test_the_lists_have_no_entry_to_spare() -> None:
    assert {path.stem for path in registry.ASSETS.glob("*.tsv")} == set(DATA_SETS)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(UsageError, match="hdm05"):
        fetch_data_set("hdm5")


def test_digests_of_binary_files_are_those_of_their_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"a\r\nb")
    assert digest_of(path) == hashlib.sha256(b"a\r\nb").hexdigest()


def test_the_page_lists_every_data_set() -> None:
    page = (Path(__file__).parents[1] / "docs" / "data.md").read_text()
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    assert set(rows) == set(DATA_SETS)
    for name, entry in DATA_SETS.items():
        assert entry.licence in rows[name] and entry.page in rows[name] and (entry.commit or "")[:7] in rows[name]
