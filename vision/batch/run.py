"""Measure many photographs: both cores, one row each, resumable, whole files only."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import cv2

from ...core.derived import note_derived
from ...core.errors import ConfigError, MagbendError, VisionError
from ...core.files import output_file, output_folder, write_bytes
from ...core.json import read_json
from ...core.orphan import end_with_parent
from ...core.owned import owning_folder
from ...core.progress import Progress, silent
from ..camera.oriented import oriented
from ..extraction.follow import follow
from ..extraction.setting import Setting
from ..measurement import Measurement, failure
from .cold import while_cold
from .inputs import VIDEOS, Source, digest, list_sources, read_source
from .overlay import overlay_png
from .state import STATE_FILE, State
from .tables import Done, FrameRow, done_with

_log = logging.getLogger(__name__)

_CHUNK = 8
_EVERY = 30
"""Of a film every so many frames are drawn, and those that were refused: to draw and
store one takes longer than to measure it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchResult:
    """Where the tables are, and the row of every photograph in their order."""

    out: Path
    frames: tuple[FrameRow, ...]

    @property
    def measured(self) -> int:
        """How many photographs could be measured."""
        return sum(frame.ok for frame in self.frames)


def extract_files(
    paths: Sequence[Path],
    out: Path,
    *,
    setting: Setting,
    overlays: bool = True,
    edges: Path | None = None,
    workers: int = 1,
    resume: bool = False,
    shared_clamp: bool | None = None,
    made_with: Sequence[Path] = (),
    progress: Progress = silent,
) -> BatchResult:
    """Measure photographs and write ``centrelines.csv``, ``frames.csv`` and overlays.

    Parameters
    ----------
    paths : sequence of Path
        Pictures, folders, runs or videos (see `inputs.list_sources`).
    out : Path
        Folder for the results; it is made.
    setting : Setting
        Calibration and options.
    overlays : bool
        Whether to draw what was found.
    edges : Path, optional
        File for the side-edge points.
    workers : int
        Processes. More than one needs a script that starts under
        ``if __name__ == "__main__":``, as everywhere in Python.
    resume : bool
        Keep what an earlier call with the same settings measured of unchanged files.
    shared_clamp : bool or None
        Whether one clamp holds the rod in all photographs, so that they give its
        direction together (`shared_clamp.shared_direction`). None: in those of a run,
        and in the frames of a video. It needs a calibration.
    made_with : sequence of Path
        Files behind `setting`, such as the calibration's, for the manifest.
    progress : callable
        Called as ``progress(done, total)``.

    Raises
    ------
    VisionError
        If a path is missing, or nothing could be measured (the tables, which say why,
        are written all the same).
    StoreError
        If `out` is a folder of somebody else, or is being written just now.
    InputError
        If nothing can be written where `out` and `edges` say.
    """
    sources = list_sources(paths)
    with owning_folder(out, "extraction", "vision extract", ours=is_made_by_us):
        if overlays:
            output_folder(out / "overlays")
        task = _Task(setting, out / "overlays" if overlays else None, edges is not None)
        state = State(
            out, edges, setting.fingerprint(), [source.image for source in sources],
            _runs(sources, shared_clamp=shared_clamp),
        )  # fmt: skip
        if edges is not None:
            read = [source.path for source in sources]
            output_file(edges, kind=".csv", taken=[*read, *state.tables])
        try:
            _measure_all(task, sources, state, workers, progress, resume=resume)
        finally:
            # After an interruption too: what is measured can be resumed.
            held = state.write()
            drawn = [out / "overlays" / source.overlay for source in sources]
            made = [*state.files, *(path for path in drawn if path.is_file())]
            seen = dict.fromkeys([*(s.path for s in sources), *made_with])
            note_derived(
                made, sources=[path for path in seen if path.is_file()],
                command="vision extract",
            )  # fmt: skip
    frames = tuple(done.row for done in held)
    if not any(frame.ok for frame in frames):
        first, count = frames[0], len(frames)
        many = f"none of the {count} photographs could be measured; "
        raise VisionError(
            f"{many if count > 1 else ''}{first.image}: "
            f"{first.reason.removeprefix(f'{first.image}: ')}"
        )
    return BatchResult(out=out, frames=frames)


def _measure_all(
    task: _Task, sources: list[Source], state: State, workers: int, progress: Progress,
    *, resume: bool,
) -> None:  # fmt: skip
    """Measure what `state` does not hold yet."""
    if resume:
        state.load(sources)
    todo = [source for source in sources if source.image not in state.done]
    progress(len(sources) - len(todo), len(sources))
    for done in _run(task, todo, workers):
        state.add(done)
        progress(len(state.done), len(sources))


def is_made_by_us(folder: Path) -> bool:
    """Return whether a run or an extraction of before the marks lies in a folder."""
    for name, key in (("run.json", "plan"), (STATE_FILE, "settings_sha256")):
        with suppress(ConfigError):
            if key in read_json(folder / name):
                return True
    return False


def _runs(sources: list[Source], *, shared_clamp: bool | None) -> dict[str, str]:
    """Return by image the name of the run that it shares a clamp with."""
    if shared_clamp is False:
        return {}
    loose = "photographs" if shared_clamp else ""
    names = Counter(run.name for run in {source.run for source in sources} if run)

    def name(run: Path | None) -> str:
        if run is None:
            return loose
        return run.name if names[run.name] == 1 else str(run)

    return {source.image: name(source.run) for source in sources}


@dataclass(frozen=True, slots=True)
class _Task:
    setting: Setting
    overlays: Path | None
    edges: bool

    def __call__(self, source: Source) -> Done:
        """Measure a photograph by itself."""
        return self.measured(source, None)[0]

    def measured(
        self, source: Source, last: Measurement | None
    ) -> tuple[Done, Measurement]:
        """Measure a photograph, or a frame after the last one of its film."""
        sha256 = ""
        photo = None
        try:
            sha256 = digest(source)
            photo = read_source(source, linear=self.setting.linear)
            if self.setting.calibration is not None:
                photo = oriented(photo, self.setting.calibration)
            measurement = follow(photo, self.setting, last)
        except MagbendError as error:
            measurement = failure("unreadable", str(error))
        except OSError as error:
            reason = error.strerror or str(error)
            measurement = failure("unreadable", f"cannot be read: {reason}")
        if (
            self.overlays is not None
            and photo is not None
            and _drawn(source, measurement)
        ):
            write_bytes(self.overlays / source.overlay, overlay_png(photo, measurement))
        done = done_with(
            source.image, sha256, measurement, self.setting.calibration,
            edges=self.edges,
        )  # fmt: skip
        return done, measurement


def _drawn(source: Source, measurement: Measurement) -> bool:
    """Whether to draw an overlay: of a film not of every frame that was measured."""
    film = source.path.suffix.lower() in VIDEOS
    return not film or not measurement.ok or (source.frame or 0) % _EVERY == 0


_task: _Task | None = None


@contextmanager
def _single_threaded_children() -> Iterator[None]:
    """Let processes that start meanwhile keep to one core each.

    The linear algebra libraries read these when they are loaded.
    """
    names = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _start_worker(task: _Task) -> None:
    global _task
    _task = task
    cv2.setNumThreads(1)
    # Ctrl-C reaches every process of the terminal; the parent alone answers it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


def _work(source: Source) -> Done:
    if _task is None:
        raise RuntimeError("the worker was not started")
    return _task(source)


def _run(task: _Task, todo: list[Source], workers: int) -> Iterator[Done]:
    """Yield results in the order of `todo`; finish alone if the workers die.

    The frames of a film are followed, one after the other: that is quicker than to
    search each anew in several processes.
    """
    finished = 0
    for done in while_cold(task, todo):
        finished += 1
        yield done
    film = any(source.frame is not None for source in todo)
    if workers > 1 and len(todo) - finished > 1 and not film:
        pool = ProcessPoolExecutor(
            min(workers, len(todo)),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_start_worker,
            initargs=(task,),
        )
        try:
            chunk = max(1, min(_CHUNK, len(todo) // workers))
            with _single_threaded_children():
                results = pool.map(_work, todo[finished:], chunksize=chunk)
            for done in results:
                finished += 1
                yield done
        except BrokenProcessPool:
            _log.warning("a worker process died; going on in this one")
        finally:
            pool.shutdown(cancel_futures=True)
    before: Source | None = None
    last: Measurement | None = None
    for source in todo[finished:]:
        near = last if before is not None and source.follows(before) else None
        done, last = task.measured(source, near)
        before = source
        yield done
