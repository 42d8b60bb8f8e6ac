"""The centreline: what vision measures and the simulator predicts.

Specimen frame (stated here, once): origin where the rod leaves the clamp (s = 0), +x
along the undeformed rod, +y to the left of +x seen by the top camera, +z up toward the
camera; millimetres. `theta_rad` is the tangent angle from +x and `kappa_per_mm` its
derivative with respect to s.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .files import write_text
from .table import read_table

COLUMNS = ("s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Centreline:
    """A plane curve from clamp to tip, sampled at increasing arc length.

    Parameters
    ----------
    s_mm, x_mm, y_mm, theta_rad, kappa_per_mm : ndarray, shape (n,)
        Arc length, position in the specimen frame, tangent angle and curvature.

    Raises
    ------
    InputError
        If the arrays differ in length, hold fewer than two points or a value that is
        not finite, or if s does not increase.
    """

    s_mm: NDArray[np.float64]
    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    theta_rad: NDArray[np.float64]
    kappa_per_mm: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in COLUMNS:
            values = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if values.ndim != 1 or values.shape != np.shape(self.s_mm):
                raise InputError(
                    f"centreline column {name} must be one-dimensional and as long as "
                    f"s_mm; instead received shape {values.shape}"
                )
            if not np.all(np.isfinite(values)):
                raise InputError(
                    f"centreline column {name} must be finite; "
                    f"instead received NaN or infinity"
                )
            object.__setattr__(self, name, values)
        if len(self.s_mm) < 2 or np.any(np.diff(self.s_mm) <= 0.0):
            raise InputError(
                "centreline s_mm must hold at least two increasing values in mm; "
                f"instead received {len(self.s_mm)} value(s) that do not increase"
            )

    @classmethod
    def _trusted(
        cls,
        s_mm: NDArray[np.float64],
        x_mm: NDArray[np.float64],
        y_mm: NDArray[np.float64],
        theta_rad: NDArray[np.float64],
        kappa_per_mm: NDArray[np.float64],
    ) -> Centreline:
        """Make one of arrays known to be right, without the checks (for solvers)."""
        line = object.__new__(cls)
        put = object.__setattr__
        put(line, "s_mm", s_mm)
        put(line, "x_mm", x_mm)
        put(line, "y_mm", y_mm)
        put(line, "theta_rad", theta_rad)
        put(line, "kappa_per_mm", kappa_per_mm)
        return line

    @property
    def length_mm(self) -> float:
        """Arc length from the first to the last point, in mm."""
        return float(self.s_mm[-1] - self.s_mm[0])

    @property
    def tip_mm(self) -> tuple[float, float]:
        """Position of the tip, in mm."""
        return float(self.x_mm[-1]), float(self.y_mm[-1])

    @property
    def tip_angle_deg(self) -> float:
        """Tangent angle at the tip, in degrees."""
        return float(np.degrees(self.theta_rad[-1]))

    @property
    def points_mm(self) -> NDArray[np.float64]:
        """Positions, shape (n, 2), in mm."""
        return np.column_stack([self.x_mm, self.y_mm])

    def to_csv(
        self, path: Path | None = None, *, z_mm: NDArray[np.float64] | None = None
    ) -> str:
        """Return the table as CSV with 15 digits; write it to `path` too, if given.

        The heights `z_mm` of a shape seen from above, shape (n,), are a last column.
        """
        columns = {name: getattr(self, name) for name in COLUMNS}
        if z_mm is not None:
            columns["z_mm"] = z_mm
        buffer = io.StringIO()
        np.savetxt(
            buffer, np.column_stack(list(columns.values())), fmt="%.15g", delimiter=",",
            header=",".join(columns), comments="",
        )  # fmt: skip
        text = buffer.getvalue()
        if path is not None:
            write_text(path, text)
        return text

    @classmethod
    def from_csv(cls, path: Path) -> Centreline:
        """Read a ``shape.csv``.

        Raises
        ------
        ConfigError
            If the file is missing, lacks a column or holds something else than numbers.
        """
        table = read_table(path)
        table.require(*COLUMNS, hint="a shape table needs them all")
        return cls(**{name: table.numbers(name) for name in COLUMNS})
