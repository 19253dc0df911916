"""Download of data sets; each file is checked by its SHA-256 and put in place by one rename."""

from __future__ import annotations

from pathlib import Path

from toolkit.datasets.folder import data_folder
from toolkit.datasets.registry import DataFile, DataSet, data_set_of, digest_of
from toolkit.io.errors import DataError, OutputError, os_errors_as
from toolkit.io.files import atomic_path, is_file
from toolkit.io.progress import Progress, silent


def fetch_data_set(data_set: DataSet | str, folder: str | Path | None = None, *, progress: Progress = silent) -> Path:
    """Bring all files of a data set into the data folder and return the data set's folder.

    A file that is there with its content is not fetched. An interrupted download continues with the next missing file.
    A second fetch of the same data set waits for the first.

    Parameters
    ----------
    data_set : data set, or its name in the registry
    folder : data folder; `data_folder()` if None
    progress : called with the data set's name, files done, all files

    Raises
    ------
    UsageError
        The registry has no such name.
    DataError
        The data set has to be fetched by hand, the server cannot be reached, sends an error or another file, or the
        folder holds another file of that name.
    OutputError
        The folder cannot be written.
    """
    from filelock import FileLock

    wanted = data_set_of(data_set) if isinstance(data_set, str) else data_set
    root = data_folder() if folder is None else Path(folder)
    place = root / wanted.folder
    if not (missing := wanted.missing(root)):
        return place
    for file in missing:
        if (root / file.path).exists() and not file.is_at(root):  # another fetch may have brought it by now
            raise DataError(
                f"{root / file.path} is another file than that of the data set {wanted.name}; "
                "move it away or name another folder with --data"
            )
    if wanted.source is None:
        raise DataError(by_hand(wanted, root))
    if is_file(root):
        raise OutputError(f"{root} is a file; name a folder with --data")
    lock = FileLock(root / f".{wanted.name}.lock")
    with os_errors_as(OutputError, f"cannot write {root}", "name a folder that can be written with --data"):
        root.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    try:
        done = len(wanted.files) - len(missing)
        for file in missing:
            if not file.is_at(root):  # a fetch that held the lock before may have brought it
                _download(file, root, wanted.name)
            done += 1
            progress(f"fetching {wanted.name}", done, len(wanted.files))
    finally:
        lock.release()
    return place


def by_hand(data_set: DataSet, folder: Path) -> str:
    """Return the instructions for a data set without an address."""
    page = f" from {data_set.page}" if data_set.page else ""
    return (
        f"the data set {data_set.name} cannot be fetched by this command (licence: {data_set.licence}). "
        f"{data_set.steps} Get it{page} and put the files into {folder / data_set.folder}; "
        f"`depthmocap data list {data_set.name}` names those that are missing"
    )


def _download(file: DataFile, root: Path, name: str) -> None:
    """Download one file and check it before it takes its place."""
    import requests
    from pooch import HTTPDownloader

    again = f"run `depthmocap data fetch {name}` again to continue"
    target = root / file.path
    timeout = 30.0  # seconds without an answer of the server after which a download fails
    with atomic_path(target, lasting=False) as temporary:
        try:
            HTTPDownloader(timeout=timeout)(file.url, str(temporary), None, check_only=False)
        except requests.HTTPError as error:
            raise DataError(f"{error}; {again}, or get the file by hand") from error
        except requests.RequestException as error:
            raise DataError(
                f"cannot download {file.url}: no connection, or the server broke off; check the network and {again}"
            ) from error
        if digest_of(temporary) != file.sha256:
            size = temporary.stat().st_size
            raise DataError(
                f"{file.url} sent another file ({size} bytes instead of {file.size}, or another SHA-256 than "
                f"{file.sha256[:12]}...), which is not kept; {again}"
            )
