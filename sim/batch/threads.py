"""Rows of arrays on all cores.

Threads rather than numba's parallel layer: that one compiles four times as long, aborts
on concurrent calls where it falls back, and does not survive a fork, while kernels that
release the interpreter (``nogil``) run on all cores, let progress be told and a stop be
asked between chunks, and load from the cache like any other.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed

from ...core.checks import whole
from ...core.progress import Progress, silent


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(
    work: Callable[[slice], None],
    rows: int,
    chunk: int,
    *,
    threads: int | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] | None = None,
) -> None:
    """Call ``work(slice)`` on every chunk of rows.

    Parameters
    ----------
    work : callable
        Does the rows of a slice.
    rows, chunk : int
        How many there are, and how many a call takes.
    threads : int, optional
        From 1 to 1024; all cores, by default.
    progress : callable
        Called as ``progress(done, rows)``, from this thread.
    stop : callable, optional
        Asked before each chunk; once it says True the rest is left.

    Raises
    ------
    InputError
        If `threads` cannot be.
    """
    workers = cores() if threads is None else whole(threads, 1, 1024, "threads")
    slices = [slice(at, min(at + chunk, rows)) for at in range(0, rows, chunk)]

    def do(part: slice) -> int:
        if stop is not None and stop():
            return 0
        work(part)
        return int(part.stop - part.start)

    done = 0
    if len(slices) <= 1 or workers == 1:
        for part in slices:
            done += do(part)
            progress(done, rows)
        return
    with ThreadPoolExecutor(workers) as pool:
        try:
            for future in as_completed([pool.submit(do, part) for part in slices]):
                done += future.result()
                progress(done, rows)
        except BaseException:  # an interrupt too: leave the chunks that wait
            pool.shutdown(wait=False, cancel_futures=True)
            raise
