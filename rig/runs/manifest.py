"""``run.json``: everything a reader in ten years needs, and what a resume compares."""

from __future__ import annotations

import dataclasses
import getpass
import platform
import socket
import sys
import uuid
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from ...core.errors import StoreError
from ...core.specimen_file import specimen_dict
from ...core.urls import without_secrets
from ..bench.config import Plan
from ..bench.devices import Devices
from .records import SCHEMA, Record

_PACKAGES = ("magbend", "numpy", "opencv-python-headless", "pyserial", "pydantic")
# What a resumed run must share with its beginning; devices may be replugged.
_SAME = ("plan", "specimen", "rig")


def make_manifest(plan: Plan, devices: Devices, *, twin: bool) -> Record:
    """Return what ``run.json`` holds.

    Parameters
    ----------
    plan : Plan
        The plan, its rig and its specimen.
    devices : Devices
        Open devices, for their identities and settings.
    twin : bool
        Whether the bench is computed.
    """
    return {
        "schema": SCHEMA,
        "id": str(uuid.uuid4()),
        "name": plan.model.name,
        "created_utc": devices.utc(),
        "plan": plan.as_dict(),
        "specimen": specimen_dict(plan.specimen),
        "rig": _without_secrets(plan.rig.model_dump(mode="json", exclude={"twin"})),
        "map": devices.stage.place_map.as_dict(),
        "assumed_gap": devices.stage.assumed,
        "devices": {
            "stage": dataclasses.asdict(devices.stage.identity),
            "stage_limits": dataclasses.asdict(devices.stage.limits),
            "camera": devices.camera.identity,
            "meter": devices.meter.identity,
            "axes": {name: axis.identity for name, axis in devices.axes.items()},
        },
        "versions": _versions(),
        "host": socket.gethostname(),
        "operator": plan.model.operator or _user(),
        "twin": twin,
        "twin_faults": plan.rig.twin.model_dump(mode="json")["fault"] if twin else [],
    }


def _without_secrets(value: Any) -> Any:
    """Return a record whose addresses hold no password: runs are given away."""
    if isinstance(value, dict):
        return {key: _without_secrets(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_secrets(item) for item in value]
    return without_secrets(value) if isinstance(value, str) else value


def require_same(old: Record, new: Record) -> None:
    """Refuse to go on with a run under another plan, specimen or rig.

    Raises
    ------
    StoreError
        If anything changed: names the key and both values.
    """
    for part in _SAME:
        change = _difference(old.get(part), _as_stored(new.get(part)), part)
        if change:
            raise StoreError(
                f"the run can be resumed only as it was begun: {change}; undo the "
                f"change, or start a new run in another folder"
            )


def _as_stored(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _as_stored(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_as_stored(item) for item in value]
    return value


def _difference(old: Any, new: Any, name: str) -> str:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            change = _difference(old.get(key), new.get(key), f"{name}.{key}")
            if change:
                return change
        return ""
    return "" if old == new else f"{name} was {old!r} and is now {new!r}"


def _versions() -> dict[str, str]:
    found = {"python": sys.version.split()[0], "platform": platform.platform()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""
