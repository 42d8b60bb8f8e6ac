"""A field that moves with the insertion: poses, and straight lines between them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...core.checks import shown
from ...core.errors import InputError
from ..fields import Field
from ..sources import Uniform

KEYS = {
    True: ("flux_mT", "angle_deg", "elevation_deg"),
    False: ("gap_mm", "axis_angle_deg", "elevation_deg"),
}
"""What a pose may say of a uniform field, and of magnets."""


def moving(
    field: Field | None, poses: Sequence[dict[str, float]]
) -> Callable[[float], Field]:
    """Return the field as a function of the insertion.

    Parameters
    ----------
    field : Field or None
        Magnets, which the poses move by `gap_mm` and `axis_angle_deg`; None or a
        uniform field: the poses give `flux_mT` and `angle_deg`, and what they leave out
        stays that of the field. Both take
        `elevation_deg`, which leads out of a planar lumen.
    poses : sequence of dict
        Each with `insertion_mm`, rising, and the same other keys. Before the first and
        after the last the field stays; between them it changes in a straight line.

    Raises
    ------
    InputError
        If a key is missing, unknown, or the insertions do not rise.

    Examples
    --------
    >>> field = moving(None, [{"insertion_mm": 0.0, "flux_mT": 0.0},
    ...                       {"insertion_mm": 10.0, "flux_mT": 20.0}])
    >>> field(5.0)
    UniformField(flux_mT=10.0, angle_deg=90.0)
    """
    sources: tuple[Any, ...] = (
        (Uniform(flux_mT=0.0),) if field is None else field.sources
    )
    uniform = [one.kind for one in sources] == ["uniform"]
    keys = KEYS[uniform]
    if not poses:
        raise InputError("poses must have at least one pose; instead received none")
    given = sorted(set(poses[0]) - {"insertion_mm"})
    for pose in poses:
        unknown = set(pose) - {"insertion_mm", *keys}
        if unknown or "insertion_mm" not in pose or set(given) - set(pose):
            raise InputError(
                f"each pose must have insertion_mm and the same of {', '.join(keys)}; "
                f"instead received {shown(pose)}"
            )
    at = [float(pose["insertion_mm"]) for pose in poses]
    if any(b <= a for a, b in itertools.pairwise(at)):
        raise InputError(
            f"insertion_mm of the poses must rise, in mm; instead received {at}"
        )

    if "gap_mm" in given and not any(_takes(one, "gap_mm") for one in sources):
        raise InputError(
            "poses with gap_mm must move a source that stands at a gap; instead all "
            "sources have a centre_mm of their own"
        )

    def here(insertion_mm: float) -> Field:
        now = {
            key: float(np.interp(insertion_mm, at, [pose[key] for pose in poses]))
            for key in given
        }
        moved = Field(
            replace(source, **{k: v for k, v in now.items() if _takes(source, k)})
            for source in sources
        )
        return moved.uniform or moved

    here(at[0])
    return here


def _takes(source: Any, key: str) -> bool:
    """Tell whether a pose moves a source by this; one at a centre stays there."""
    if key == "gap_mm":
        return source.follows_gap or getattr(source, "gap_mm", None) is not None
    return hasattr(source, key)
