"""Pool of processes that read mocap and observe poses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from itertools import islice
from typing import Any

from toolkit.io.errors import DatabaseError
from toolkit.io.workers import task_of


@contextmanager
def process_pool(workers: int) -> Iterator[Callable[..., Iterator[Any]]]:
    """Yield a `map` in order over `workers` processes, or the built-in one for a single worker.

    The pool is joblib's, so that inside `joblib.parallel_config(backend="dask")` a cluster replaces it. At most
    8 results per process are buffered, so that memory does not grow with the number of items.

    Raises
    ------
    DatabaseError
        A process was killed.
    """
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    around = joblib.parallel.get_active_backend()[0]
    if workers <= 1 and isinstance(around, joblib.parallel.LokyBackend):
        yield map
        return

    def mapped(function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        rest, waiting = iter(items), 8  # unread results per process
        while some := list(islice(rest, waiting * workers)):
            yield from parallel(joblib.delayed(task_of(function))(item) for item in some)

    own = isinstance(around, joblib.parallel.LokyBackend)
    try:
        with joblib.parallel_config("loky", inner_max_num_threads=1) if own else nullcontext():
            with joblib.Parallel(n_jobs=workers, return_as="generator") as parallel:
                yield mapped
    except TerminatedWorkerError as error:
        raise DatabaseError(
            "a process of the build was killed, perhaps by lack of memory; use fewer workers"
        ) from error
