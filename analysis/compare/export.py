"""Tables for other programs: CSV, Parquet and MATLAB, units in the column names."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ...core.errors import InputError, MissingExtraError
from ...core.files import output_file, output_folder, write_bytes, write_text
from ...core.text import defused
from ...core.units import T_from_mT
from .compare import RunComparison, comparison_table
from .hierarchy import check_hdf5, nexus

if TYPE_CHECKING:
    import pandas as pd

FORMATS = (".csv", ".parquet", ".mat", ".h5", ".nxs", ".txt")


def tables(runs: Sequence[RunComparison]) -> dict[str, pd.DataFrame]:
    """Return the tidy tables of all runs.

    Returns
    -------
    dict of str to DataFrame
        ``points`` (measured, one row a point), ``simulated`` (the same of the
        predictions, with the field model), ``steps`` and ``comparison``.
    """
    import pandas as pd

    def join(parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
        return pd.concat(list(parts), ignore_index=True)

    return {
        "points": join([run.run.points_table for run in runs]),
        "simulated": join([_simulated(run) for run in runs]),
        "steps": join([run.run.steps_table for run in runs]),
        "comparison": comparison_table(runs),
    }


def _simulated(run: RunComparison) -> pd.DataFrame:
    import pandas as pd

    parts = []
    for comparison in run.comparisons:
        line = comparison.solution.centreline if comparison.solution else None
        if line is None:
            continue
        parts.append(
            pd.DataFrame(
                {
                    "run": comparison.run,
                    "step": comparison.step.index,
                    "model": comparison.model,
                    "s_mm": line.s_mm,
                    "x_mm": line.x_mm,
                    "y_mm": line.y_mm,
                    "theta_rad": line.theta_rad,
                    "kappa_per_mm": line.kappa_per_mm,
                }
            )
        )
    if not parts:
        return pd.DataFrame(columns=["run", "step", "model", "s_mm", "x_mm", "y_mm"])
    return pd.concat(parts, ignore_index=True)


def export_runs(runs: Sequence[RunComparison], out: Path) -> list[Path]:
    """Write the tables of all runs.

    Parameters
    ----------
    runs : sequence of RunComparison
        From `compare_run`.
    out : Path
        ``NAME.mat`` is one file with a struct a table; ``NAME.csv`` and
        ``NAME.parquet`` become one file a table (``NAME_points.csv``, ...); ``NAME.h5``
        or ``.nxs`` is NeXus; ``NAME.txt`` is a table that COMSOL interpolates: flux
        density and arc length, then x, y and theta as measured. A name without ending
        is a folder that gets CSV, Parquet and .mat.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    InputError
        If the ending is none of these.
    MissingExtraError
        If Parquet is asked for and pyarrow is not installed.
    """
    ending = check_export(out)
    if ending in (".h5", ".nxs"):
        write_bytes(out, nexus(runs))
        return [out]
    if ending == ".txt":
        write_text(out, comsol_table(runs))
        return [out]
    data = tables(runs)
    if not ending:
        written = _write(data, out / "runs.csv", ".csv")
        if _has_parquet():
            written += _write(data, out / "runs.parquet", ".parquet")
        return written + _write(data, out / "runs.mat", ".mat")
    return _write(data, out, ending)


def comsol_table(runs: Sequence[RunComparison]) -> str:
    """Return the measured lines as COMSOL's spreadsheet of an interpolation, in SI.

    Two arguments (flux density and arc length), three functions (x, y, theta); heads in
    the last ``%`` line.

    Raises
    ------
    InputError
        If the runs have different rods, or a step has no flux density.
    """
    names = {run.run.specimen.name for run in runs}
    if len(names) > 1:
        raise InputError(
            "a table for COMSOL must be of one rod; instead received "
            f"{', '.join(sorted(names))}: export each for itself"
        )
    rows = []
    for run in runs:
        for step in run.run.steps:
            frame = run.run.frame(step)
            line = frame.centreline if frame else None
            if line is None:
                continue
            if not math.isfinite(step.flux_mT):
                raise InputError(
                    f"{run.run.label}, step {step.index + 1}: has no flux density, "
                    "which is the first argument of a table for COMSOL"
                )
            rows += [
                (T_from_mT(step.flux_mT), *values)
                for values in zip(
                    line.s_mm * 1e-3, line.x_mm * 1e-3, line.y_mm * 1e-3,
                    line.theta_rad, strict=True,
                )
            ]  # fmt: skip
    head = (
        f"% Rod: {names.pop()}\n"
        "% Measured; interpolate x, y and theta over flux and s\n"
        "% flux (T)   s (m)   x (m)   y (m)   theta (rad)\n"
    )
    return head + "".join(
        "   ".join(f"{value:.12g}" for value in row) + "\n" for row in rows
    )


def check_export(out: Path) -> str:
    """Return the ending of an export, empty for a folder; call it before the work.

    Raises
    ------
    InputError
        If the ending is none of `FORMATS`, or nothing can be written there.
    MissingExtraError
        If Parquet is asked for and pyarrow is not installed.
    """
    ending = out.suffix.lower()
    if ending and ending not in FORMATS:
        raise InputError(
            f"export must end in {', '.join(FORMATS)} or be a folder; "
            f"instead received {out.name!r}"
        )
    if ending == ".parquet":
        _check_parquet()
    if ending in (".h5", ".nxs"):
        check_hdf5()
    if ending:
        output_file(out)
    else:
        output_folder(out)
    return ending


def _write(data: dict[str, pd.DataFrame], out: Path, ending: str) -> list[Path]:
    if ending == ".mat":
        write_bytes(out, _matlab(data))
        return [out]
    written = []
    for name, table in data.items():
        path = out.with_name(f"{out.stem}_{name}{ending}")
        if ending == ".csv":
            cells = table.map(defused)
            write_text(path, cells.to_csv(index=False, lineterminator="\n"))
        else:
            buffer = io.BytesIO()
            table.to_parquet(buffer, index=False)
            write_bytes(path, buffer.getvalue())
        written.append(path)
    return written


def _matlab(data: dict[str, pd.DataFrame]) -> bytes:
    """Return a .mat (version 5) with one struct a table, one column vector a field."""
    from scipy.io import savemat

    def column(values: Any) -> Any:
        if values.dtype.kind in "fiub":
            return values.to_numpy(dtype=np.float64)[:, None]
        return np.array(values.astype(str).tolist(), dtype=object)[:, None]

    content = {
        name: {key: column(table[key]) for key in table} for name, table in data.items()
    }
    buffer = io.BytesIO()
    savemat(cast("Any", buffer), content, do_compression=True, long_field_names=True)
    return buffer.getvalue()


def _has_parquet() -> bool:
    from importlib.util import find_spec

    return find_spec("pyarrow") is not None


def _check_parquet() -> None:
    if not _has_parquet():
        raise MissingExtraError("pyarrow", "library", "a Parquet table")
