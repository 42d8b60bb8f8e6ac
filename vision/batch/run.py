"""Measure many photographs: both cores, one row each, resumable, whole files only."""

from __future__ import annotations

import hashlib
import json
import logging
import math
import multiprocessing
import os
import signal
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

from ...core.errors import MagbendError, VisionError
from ...core.files import output_file, output_folder, write_bytes
from ...core.progress import Progress, silent
from ..camera.calibration import Calibration
from ..extraction.extract import extract
from ..measurement import Measurement, failure
from ..picture.photo import Photo, read_photo
from . import tables
from .inputs import Source, digest, list_sources, read_source
from .overlay import overlay_png
from .state import State
from .tables import Done

_log = logging.getLogger(__name__)

_CHUNK = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How every photograph of a batch is measured; see `extract`.

    Parameters
    ----------
    calibration : Calibration or None
        None measures in pixels only.
    rod_height_mm : float
        Height of the rod's axis above the board's plane.
    invert : bool or None
        Light rod on dark ground; None looks for itself.
    joints_mm : tuple of float
        Arc lengths at which the stiffness jumps.
    length_mm : float or None
        Nominal length, to check against.
    clamp : {"auto", "none"}
        ``none`` also measures rods that float freely.
    clamp_height_mm : float or None
        Height of the clamp's top above the board's plane.
    bare : Photo or None
        The same scene without rod and clamp: its light is divided out.
    """

    calibration: Calibration | None = None
    rod_height_mm: float = 0.0
    invert: bool | None = None
    joints_mm: tuple[float, ...] = ()
    length_mm: float | None = None
    clamp: Literal["auto", "none"] = "auto"
    clamp_height_mm: float | None = None
    bare: Photo | None = None

    def fingerprint(self) -> str:
        """Return a digest that changes with everything that changes a result."""
        data: dict[str, Any] = {
            "rod_height_mm": self.rod_height_mm,
            "invert": self.invert,
            "joints_mm": self.joints_mm,
            "length_mm": self.length_mm,
            "clamp": self.clamp,
            "clamp_height_mm": self.clamp_height_mm,
        }
        if self.calibration is not None:
            data["calibration"] = _plain(asdict(self.calibration))
        if self.bare is not None:
            data["bare"] = hashlib.sha256(self.bare.grey.tobytes()).hexdigest()
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchResult:
    """Where the tables are, and the row of every photograph in their order."""

    out: Path
    frames: tuple[tables.FrameRow, ...]

    @property
    def measured(self) -> int:
        """How many photographs could be measured."""
        return sum(frame.ok for frame in self.frames)


def measure(photo: Photo, settings: Settings) -> Measurement:
    """Measure one photograph; a refusal is a value, never an exception.

    Parameters
    ----------
    photo : Photo
        The photograph.
    settings : Settings
        Calibration and options.
    """
    width, height = photo.size_px
    if settings.calibration is not None:
        try:
            settings.calibration.check_size(width, height)
        except VisionError as error:
            return failure("calibration_mismatch", str(error))
    if settings.bare is not None:
        if settings.bare.size_px != photo.size_px:
            return failure(
                "bare_mismatch",
                "the bare frame and the photograph differ in size: "
                f"{settings.bare.size_px} and {photo.size_px} px",
            )
        photo = replace(photo, grey=_flattened(photo, settings.bare))
    return extract(
        photo,
        settings.calibration,
        rod_height_mm=settings.rod_height_mm,
        invert=settings.invert,
        joints_mm=settings.joints_mm,
        length_mm=settings.length_mm,
        clamp=settings.clamp,
        clamp_height_mm=settings.clamp_height_mm,
    )


def extract_files(
    paths: Sequence[Path],
    out: Path,
    *,
    settings: Settings,
    overlays: bool = True,
    edges: Path | None = None,
    workers: int = 1,
    resume: bool = False,
    shared_clamp: bool | None = None,
    progress: Progress = silent,
) -> BatchResult:
    """Measure photographs and write ``centrelines.csv``, ``frames.csv`` and overlays.

    Parameters
    ----------
    paths : sequence of Path
        Pictures, folders, runs or videos (see `inputs.list_sources`).
    out : Path
        Folder for the results; it is made.
    settings : Settings
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
    progress : callable
        Called as ``progress(done, total)``.

    Raises
    ------
    VisionError
        If a path is missing, or nothing could be measured (the tables, which say why,
        are written all the same).
    InputError
        If nothing can be written where `out` and `edges` say.
    """
    sources = list_sources(paths)
    output_folder(out / "overlays" if overlays else out)
    if edges is not None:
        output_file(edges)
    state = State(
        out, edges, settings.fingerprint(), [source.image for source in sources],
        _runs(sources, shared_clamp=shared_clamp),
    )  # fmt: skip
    if resume:
        state.load(sources)
    todo = [source for source in sources if source.image not in state.done]
    task = _Task(settings, out / "overlays" if overlays else None, edges is not None)
    progress(len(sources) - len(todo), len(sources))
    try:
        for done in _run(task, todo, workers):
            state.add(done)
            progress(len(state.done), len(sources))
    finally:
        # After an interruption too: what is measured can be resumed.
        state.write()
    frames = tuple(tables.read_frames(out / "frames.csv"))
    if not any(frame.ok for frame in frames):
        first = frames[0]
        raise VisionError(
            f"none of the {len(frames)} photographs could be measured; "
            f"{first.image}: {first.reason.removeprefix(f'{first.image}: ')}"
        )
    return BatchResult(out=out, frames=frames)


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
    settings: Settings
    overlays: Path | None
    edges: bool

    def __call__(self, source: Source) -> Done:
        sha256 = ""
        photo = None
        try:
            sha256 = digest(source)
            photo = read_source(source)
            measurement = measure(photo, self.settings)
        except (MagbendError, OSError) as error:
            measurement = failure("unreadable", str(error))
        if self.overlays is not None and photo is not None:
            write_bytes(self.overlays / source.overlay, overlay_png(photo, measurement))
        return Done(
            source.image,
            sha256,
            tables.frame_row(source.image, measurement),
            tables.centreline_rows(source.image, measurement),
            tables.edge_rows(source.image, measurement, self.settings.calibration)
            if self.edges
            else "",
        )


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


def _work(source: Source) -> Done:
    if _task is None:
        raise RuntimeError("the worker was not started")
    return _task(source)


def _run(task: _Task, todo: list[Source], workers: int) -> Iterator[Done]:
    """Yield results in the order of `todo`; finish alone if the workers die."""
    finished = 0
    if workers > 1 and len(todo) > 1:
        pool = ProcessPoolExecutor(
            min(workers, len(todo)),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_start_worker,
            initargs=(task,),
        )
        try:
            chunk = max(1, min(_CHUNK, len(todo) // workers))
            with _single_threaded_children():
                results = pool.map(_work, todo, chunksize=chunk)
            for done in results:
                finished += 1
                yield done
        except BrokenProcessPool:
            _log.warning("a worker process died; going on in this one")
        finally:
            pool.shutdown(cancel_futures=True)
    for source in todo[finished:]:
        yield task(source)


def _flattened(photo: Photo, bare: Photo) -> np.ndarray:
    """Return the light of a photograph divided by that of the bare scene."""
    smooth = cv2.GaussianBlur(bare.grey, (0, 0), 4.0)
    typical = float(np.median(smooth))
    return np.asarray(
        photo.grey * (typical / np.maximum(smooth, 0.05 * typical)), dtype=np.float32
    )


def read_bare(path: Path) -> Photo:
    """Read the photograph of the bare scene.

    Raises
    ------
    VisionError
        If it cannot be read or is dark.
    """
    photo = read_photo(path)
    if float(np.median(photo.grey)) < 0.02:
        raise VisionError(f"{path}: the bare frame must show lit paper; it is dark")
    return photo


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
