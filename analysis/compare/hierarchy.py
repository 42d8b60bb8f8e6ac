"""Runs as NeXus/HDF5: an entry a run, a group a step, units beside every column."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import COLUMNS, Centreline
from ...core.columns import split_unit
from ...core.errors import MissingExtraError
from ...core.specimen_file import specimen_dict
from .compare import RunComparison

if TYPE_CHECKING:
    import h5py


def check_hdf5() -> None:
    """Refuse if h5py is not installed.

    Raises
    ------
    MissingExtraError
        With the extra that brings it.
    """
    from importlib.util import find_spec

    if find_spec("h5py") is None:
        raise MissingExtraError("h5py", "hdf5", "a NeXus/HDF5 file")


def nexus(runs: Sequence[RunComparison]) -> bytes:
    """Return a NeXus file: ``/RUN/step_000/measured``, ``.../uniform``, ....

    Every group of a line is an NXdata whose signal is y over x; every column has an
    attribute ``units``; the specimen is an NXsample, its keys those of its file.
    """
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", track_order=True) as file:
        file.attrs["NX_class"] = "NXroot"
        file.attrs["creator"] = "magbend"
        file.attrs["default"] = runs[0].run.label
        for run in runs:
            _entry(file.create_group(run.run.label, track_order=True), run)
    return buffer.getvalue()


def _entry(entry: h5py.Group, run: RunComparison) -> None:
    entry.attrs["NX_class"] = "NXentry"
    entry["title"] = run.run.name
    entry["start_time"] = str(run.run.record.get("created_utc", ""))
    entry["entry_identifier"] = run.run.id
    sample = entry.create_group("sample")
    sample.attrs["NX_class"] = "NXsample"
    for key, value in specimen_dict(run.run.specimen).items():
        if isinstance(value, list):
            for i, section in enumerate(value, start=1):
                _scalars(sample.create_group(f"section_{i}"), section)
        elif isinstance(value, (str, int, float)):
            _scalars(sample, {key: value})
    for step in run.run.steps:
        group = entry.create_group(f"step_{step.index:03d}", track_order=True)
        group.attrs["NX_class"] = "NXcollection"
        _scalars(
            group,
            {
                "gap_mm": step.gap_mm,
                "flux_mT": step.flux_mT,
                "flux_sd_mT": step.flux_sd_mT,
                "image": step.image,
            },
        )
        frame = run.run.frame(step)
        if frame is not None and frame.centreline is not None:
            more = {"sigma_mm": frame.sigma_mm} if len(frame.sigma_mm) else {}
            _line(group.create_group("measured"), frame.centreline, more)
        for comparison in run.comparisons:
            shape = comparison.solution.centreline if comparison.solution else None
            if comparison.step is step and shape is not None:
                _line(group.create_group(comparison.model), shape, {})


def _scalars(group: h5py.Group, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        group[name] = value
        unit = split_unit(name)[1]
        if unit:
            group[name].attrs["units"] = unit


def _line(
    group: h5py.Group, line: Centreline, more: Mapping[str, NDArray[np.float64]]
) -> None:
    group.attrs["NX_class"] = "NXdata"
    group.attrs["signal"] = "y_mm"
    group.attrs["axes"] = "x_mm"
    columns = {name: getattr(line, name) for name in COLUMNS}
    _scalars(group, {**columns, **more})
