"""Rods whose stiffness, size or magnetisation varies along them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .arrays import real_array
from .checks import shown, whole
from .errors import InputError
from .specimen import Section


def profile_sections(
    s_mm: Sequence[float], *, pieces: int = 60, **columns: Sequence[float]
) -> tuple[Section, ...]:
    """Return the sections of a rod given by values along it.

    Parameters
    ----------
    s_mm : sequence of float
        Rising arc lengths from the clamp, from 0 to the rod's length, in mm.
    pieces : int
        Sections of equal length; each has the values at its middle, so that what they
        leave falls with the second power of their number.
    **columns : sequence of float
        What varies, at `s_mm`, linear between: ``E_MPa``, and any other number that a
        `Section` may have of its own.

    Raises
    ------
    InputError
        If `s_mm` does not rise from 0, or a column is missing, unknown or of another
        length.
    """
    s = real_array(s_mm, "profile s_mm", "mm")
    if s.ndim != 1 or len(s) < 2 or s[0] != 0.0 or np.any(np.diff(s) <= 0.0):
        raise InputError(
            "profile s_mm in mm must rise from 0 to the length of the rod; instead "
            f"received {shown(s_mm)}"
        )
    known = set(Section.__dataclass_fields__) - {"length_mm"}
    if "E_MPa" not in columns or not set(columns) <= known:
        raise InputError(
            f"a profile must have E_MPa in MPa and may have {', '.join(sorted(known))};"
            f" instead received {', '.join(columns) or 'none'}"
        )
    edges = np.linspace(0.0, s[-1], whole(pieces, 1, 100_000, "pieces") + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    values = {}
    for name, given in columns.items():
        column = real_array(given, f"profile {name}", "")
        if column.shape != s.shape:
            raise InputError(
                f"profile {name} must have {len(s)} values, one for each s_mm; instead "
                f"received {column.size}"
            )
        values[name] = np.interp(middle, s, column).tolist()
    return tuple(
        Section(
            length_mm=float(edges[i + 1] - edges[i]),
            **{name: column[i] for name, column in values.items()},
        )
        for i in range(len(middle))
    )
