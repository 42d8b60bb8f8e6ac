"""A run as one NeXus/HDF5 file: photographs, gaps, flux densities and their setting.

Base classes of the NeXus standard (nexusformat.org): NXentry, NXsample, NXuser,
NXinstrument with an NXpositioner, an NXsensor and an NXdetector, and an NXdata that
plots by itself. Lengths in mm, flux densities in mT, as ``units`` says.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.errors import StoreError
from ...core.files import beside
from .read import Run

if TYPE_CHECKING:
    import h5py


def write_nexus(run: Run, path: Path) -> int:
    """Write a run into an HDF5 file; return how many photographs it holds.

    Raises
    ------
    StoreError
        If h5py is not installed, the file exists or cannot be written, or a
        photograph is missing or of another size than the first.
    """
    try:
        import h5py
    except ImportError:
        raise StoreError("NeXus files need h5py: pip install 'magbend[hdf5]'") from None
    if path.exists():
        raise StoreError(f"{path}: is there already; name another file")
    try:
        with beside(path) as temporary, h5py.File(temporary, "w") as file:
            return _fill(file, run)
    except OSError as error:
        reason = error.strerror or error
        raise StoreError(f"{path}: cannot be written: {reason}") from None


def _fill(file: h5py.File, run: Run) -> int:
    file.attrs["default"] = "entry"
    manifest = run.manifest
    entry = _group(file, "entry", "NXentry")
    entry.attrs["default"] = "data"
    entry["title"] = run.name
    entry["entry_identifier"] = str(manifest.get("id", ""))
    entry["start_time"] = str(manifest.get("created_utc", ""))
    entry["end_time"] = str((run.end or {}).get("time_utc", ""))
    entry["program_name"] = "magbend"
    entry["run_status"] = run.status
    sample = _group(entry, "sample", "NXsample")
    specimen = manifest.get("specimen", {})
    sample["name"] = str(specimen.get("name", ""))
    sample["description"] = _json(specimen)
    _group(entry, "user", "NXuser")["name"] = str(manifest.get("operator", ""))
    for name in ("plan", "rig", "map", "devices", "versions"):
        note = _group(entry, name, "NXnote")
        note["type"], note["data"] = "application/json", _json(manifest.get(name))
    instrument = _group(entry, "instrument", "NXinstrument")
    _numbers(instrument, "stage", "NXpositioner", run, "gap_reached_mm", "mm")
    instrument["stage/raw_value"] = _column(run, "stage_mm")
    instrument["stage/raw_value"].attrs["units"] = "mm"
    meter = _numbers(instrument, "meter", "NXsensor", run, "flux_mT", "mT")
    meter["measurement"] = "magnetic_field"
    meter["value_errors"] = _column(run, "flux_sd_mT")
    count = _photographs(_group(instrument, "camera", "NXdetector"), run)
    _default_plot(entry, run)
    return count


def _group(parent: Any, name: str, nx_class: str) -> Any:
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    return group


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, sort_keys=True)


def _column(run: Run, key: str) -> np.ndarray[Any, Any]:
    """Return one number a step; NaN where there is none."""
    values = [step.get(key) for step in run.steps]
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def _numbers(
    instrument: Any, name: str, nx_class: str, run: Run, key: str, unit: str
) -> Any:
    group = _group(instrument, name, nx_class)
    group["name"] = name
    group["value"] = _column(run, key)
    group["value"].attrs["units"] = unit
    return group


def _photographs(camera: Any, run: Run) -> int:
    import cv2

    data = None
    for number, step in enumerate(run.steps):
        path = run.path / step["files"][0]["path"] if step["files"] else None
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path else None
        if image is None:
            raise StoreError(f"step {step['index'] + 1}: its photograph is missing")
        if image.ndim == 3:
            image = image[:, :, ::-1]  # red first, as everywhere but in OpenCV
        if data is None:
            data = camera.create_dataset(
                "data", (len(run.steps), *image.shape), image.dtype,
                chunks=(1, *image.shape), compression="gzip", compression_opts=4,
            )  # fmt: skip
        if data.shape[1:] != image.shape:
            raise StoreError(
                f"step {step['index'] + 1}: its photograph is {image.shape} pixels, "
                f"the first is {data.shape[1:]}"
            )
        data[number] = image
    return 0 if data is None else len(run.steps)


def _default_plot(entry: Any, run: Run) -> None:
    """Make the file plot flux density over the gap by itself; link the pictures."""
    data = _group(entry, "data", "NXdata")
    data.attrs["signal"] = "flux_density"
    data.attrs["axes"] = ["gap"]
    data["gap"] = entry["instrument/stage/value"]
    data["flux_density"] = entry["instrument/meter/value"]
    if "data" in entry["instrument/camera"]:
        data["photographs"] = entry["instrument/camera/data"]
    flags = [" ".join(step.get("flags") or []) for step in run.steps]
    kinds = [str(step.get("kind", "approach")) for step in run.steps]
    times = [str(step.get("time_utc", "")) for step in run.steps]
    for name, words in (("flags", flags), ("kind", kinds), ("time", times)):
        entry[name] = words
