"""Doors for others: what installed packages offer by entry points.

A package of somebody else declares, say, ``[project.entry-points."magbend.stages"]``
``xyz = "their_package:XyzStage"``; the name is then a kind of stage like ours. Nothing
is loaded until it is asked for, so that a broken package harms nobody who does not use
it.
"""

from __future__ import annotations

from collections.abc import Collection
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from .errors import ConfigError

GROUPS = (
    "magbend.stages",
    "magbend.cameras",
    "magbend.meters",
    "magbend.sources",
    "magbend.descriptors",
)


def offered(group: str) -> tuple[str, ...]:
    """Return the names that installed packages offer in a group, sorted."""
    return tuple(sorted({point.name for point in entry_points(group=group)}))


def load_plugin(group: str, name: str, own: Collection[str] = ()) -> Any:
    """Load what a package offers under a name.

    Parameters
    ----------
    group : str
        One of `GROUPS`.
    name : str
        As the user wrote it.
    own : collection of str
        Names that are ours; they are listed where `name` is unknown.

    Raises
    ------
    ConfigError
        If nobody offers the name, two packages do, or the package's code cannot be
        loaded: one sentence that names the package.
    """
    points = [point for point in entry_points(group=group) if point.name == name]
    if not points:
        known = ", ".join(sorted({*own, *offered(group)}))
        raise ConfigError(f"kind must be one of {known}; instead {name!r}")
    if len(points) > 1:
        packages = " and ".join(sorted(package_of(point) for point in points))
        raise ConfigError(
            f"{name!r} is offered by {packages}; uninstall one of them ({group})"
        )
    try:
        return points[0].load()
    except Exception as error:  # whatever a stranger's module does on import
        raise ConfigError(
            f"{name!r} of the package {package_of(points[0])} cannot be loaded: "
            f"{type(error).__name__}: {error}; mend or uninstall it ({group})"
        ) from None


def package_of(point: EntryPoint) -> str:
    """Return the name of the package that declares an entry point."""
    return point.dist.name if point.dist else point.value.split(":")[0]
