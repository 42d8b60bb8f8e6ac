"""A path of tips: where the tip shall be in each of several fields, as a table."""

from __future__ import annotations

from pathlib import Path

from ...core.errors import InputError
from ...core.magnet import Magnet
from ...core.table import read_table
from ...sim import Field, UniformField, before
from .goals import read_points, tip_goal
from .search import Task


def read_path(
    path: Path, *, angle_deg: float = 90.0, magnet: Magnet | Field | None = None
) -> list[Task]:
    """Return the goals of a table with ``flux_mT`` or ``gap_mm``, ``x_mm``, ``y_mm``.

    Parameters
    ----------
    path : Path
        One row a field and the tip that is wanted in it.
    angle_deg : float
        Direction of uniform fields.
    magnet : Magnet or Field, optional
        Of sources that wait for the gaps.

    Raises
    ------
    ConfigError, InputError
        If a column is missing, or the table does not go with the magnet.
    """
    by_gap = "gap_mm" in read_table(path).names
    if by_gap != (magnet is not None):
        raise InputError(
            f"{path}: a path has flux_mT, x_mm, y_mm, or with --magnet gap_mm, x_mm, "
            "y_mm; instead it has the other column"
        )
    tips = read_points(path, ("x_mm", "y_mm"))
    first = read_points(path, ("gap_mm" if by_gap else "flux_mT", "x_mm"))[:, 0]
    if not by_gap and not all(first):
        raise InputError(f"{path}: flux_mT must not be zero: no rod bends without")
    fields = [
        before(magnet).at_gap(float(value))
        if magnet is not None
        else UniformField(flux_mT=float(value), angle_deg=angle_deg)
        for value in first
    ]
    return [
        (tip_goal(float(x), float(y)), field)
        for (x, y), field in zip(tips, fields, strict=True)
    ]
