"""What the newest scan of the field says about the magnet."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ...core.errors import InputError
from ..workspace import Workspace, require


def judge_newest_scan(workspace: Workspace) -> dict[str, Any]:
    """Return the remanence of the newest ``scans/*/field.csv``, and every reading.

    Raises
    ------
    InputError
        If there is no scan yet, or its readings cannot be fitted.
    ConfigError
        If the rig file has no magnet, or the table cannot be read.
    """
    from ...sim import fit_magnet, read_readings

    found = sorted(workspace.folder.glob("scans/*/field.csv"))
    if not found:
        raise InputError("the field has not been scanned yet")
    rig = require(workspace.files().rig, workspace.files().problems, "rig")
    magnet = require(rig.magnet, {}, "[magnet]").magnet()
    gaps_mm, flux_mT, _ = read_readings(found[-1])
    fit = fit_magnet(gaps_mm, flux_mT, sides_mm=magnet.sides_mm)
    return {
        "scan": found[-1].parent.name,
        "remanence_T": fit.remanence_T,
        "remanence_sd_T": fit.remanence_sd_T,
        "in_file_T": magnet.remanence_T,
        "readings": [asdict(reading) for reading in fit.readings],
    }
