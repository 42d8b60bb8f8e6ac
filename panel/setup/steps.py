"""The steps of the path, what each still needs, and the values it shows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import ConfigError
from ...core.files import write_text
from ...core.json import read_json

if TYPE_CHECKING:
    from ...rig import RigModel
    from ..panel import Panel

MARKS_FILE = "panel-setup.json"
"""Which steps a person has said are done, and when."""

STEPS = (
    "files", "stage", "gap", "interlock", "camera", "board", "height", "meter",
    "magnet", "specimen", "plan",
)  # fmt: skip

RIG_KEYS: dict[str, tuple[str, ...]] = {
    "name": ("name",),
    "driver": ("stage", "driver"),
    "port": ("stage", "port"),
    "axis": ("stage", "axis"),
    "direction": ("stage", "direction"),
    "homing": ("stage", "homing"),
    "feed_mm_min": ("stage", "feed_mm_min"),
    "backlash_mm": ("stage", "backlash_mm"),
    "steps_per_mm": ("stage", "steps_per_mm"),
    "travel_mm": ("stage", "travel_mm"),
    "min_gap_mm": ("limits", "min_gap_mm"),
    "max_gap_mm": ("limits", "max_gap_mm"),
    "contact_gap_mm": ("limits", "contact_gap_mm"),
    "backend": ("camera", "backend"),
    "source": ("camera", "source"),
    "exposure": ("camera", "exposure"),
    "gain": ("camera", "gain"),
    "meter": ("meter", "driver"),
    "meter_port": ("meter", "port"),
    "zero_mT": ("meter", "zero_mT"),
    "sign": ("meter", "sign"),
    "side_mm": ("magnet", "side_mm"),
    "remanence_T": ("magnet", "remanence_T"),
    "up": ("bench", "up"),
}
"""What the path writes into the rig file, and where it stands there."""


def rig_values(panel: Panel) -> dict[str, Any]:
    """Return the values of the rig file that the path shows; None where not said."""
    rig = panel.workspace.files().rig
    if rig is None:
        return {}
    data = rig.model_dump(mode="json")
    values = {}
    for name, path in RIG_KEYS.items():
        value: Any = data
        for key in path:
            value = value.get(key) if isinstance(value, dict) else None
        values[name] = value
    return values


def setup_state(panel: Panel) -> dict[str, Any]:
    """Return every step with its state, the values, and what the board is set to."""
    from ...rig import ready_meters

    done, rig = done_steps(panel), panel.workspace.files().rig
    return {
        "steps": [{"name": name, "done": name in done} for name in STEPS],
        "values": rig_values(panel),
        "marks": marks(panel.workspace.folder),
        "meters": ["manual", "none", "twin", *ready_meters()],
        "shots": shots(panel.workspace.folder),
        "specimen": _specimen(panel),
        "tested": panel.direction is not None or was_tested(rig),
        "audit": audit(panel),
    }


def done_steps(panel: Panel) -> set[str]:
    """Return the steps that need nothing more."""
    workspace = panel.workspace
    files, said = workspace.files(), marks(workspace.folder)
    parts = panel.owner.parts
    proved = {
        "files": files.rig is not None,
        "stage": parts is not None and parts.stage is not None,
        "camera": parts is not None and parts.camera is not None,
        "board": files.calibration is not None,
        "plan": files.plan is not None,
        "specimen": files.specimen is not None,
    }
    asked = {"gap", "interlock", "height", "meter", "magnet", "specimen", "camera"}
    return {
        name
        for name in STEPS
        if proved.get(name, True) and (name not in asked or name in said)
    }


def marks(folder: Path) -> dict[str, str]:
    """Return when which step was done."""
    try:
        data = read_json(folder / MARKS_FILE)
    except ConfigError:
        return {}
    return {str(k): str(v) for k, v in data.items()}


def mark(folder: Path, step: str, now_utc: str) -> None:
    """Note that a step was done."""
    noted = {**marks(folder), step: now_utc}
    write_text(folder / MARKS_FILE, json.dumps(noted, indent=1) + "\n")


def shots(folder: Path) -> list[str]:
    """Return the photographs of the board taken so far, the plane one first."""
    found = sorted(path.name for path in (folder / "board").glob("*.png"))
    return sorted(found, key=lambda name: name != "plane.png")


def audit(panel: Panel) -> list[dict[str, str]]:
    """Return the board's settings that matter, beside what the rig file says."""
    facts = panel.owner.view().facts
    settings, values = facts.get("settings") or {}, rig_values(panel)
    axis = "XYZ".find(str(values.get("axis") or "X"))
    wanted = (
        (f"{100 + axis}", "steps per mm", "steps_per_mm"),
        (f"{110 + axis}", "top speed, mm/min", "max_feed_mm_min"),
        (f"{120 + axis}", "acceleration, mm/s²", ""),
        (f"{130 + axis}", "travel, mm", "travel_mm"),
        ("20", "soft limits", ""),
        ("21", "hard limits", ""),
        ("22", "homing", ""),
        ("1", "motors stay on (255)", ""),
    )
    rows = []
    for number, means, key in wanted:
        if number in settings:
            said = values.get(key)
            text = "" if said is None else f"{said:g}"
            rows.append(
                {
                    "setting": f"${number}", "means": means, "board": settings[number],
                    "file": text, "key": key if key in RIG_KEYS else "",
                    "cure": _cure(number, settings[number], said),
                }
            )  # fmt: skip
    return rows


def _cure(number: str, board: str, said: Any) -> str:
    value = float(board)
    if said is not None and abs(value - float(said)) > 1e-3:
        return f"differs: send ${number}={said:g} to the board, or take its value over"
    cures = {
        "20": "send $20=1: the board refuses moves beyond its travel",
        "21": "send $21=1 once the switches are wired: they stop a crash",
        "22": "send $22=1, or set homing = manual in the rig file",
    }
    if number in cures and value == 0.0:
        return cures[number]
    if number == "1" and value != 255.0:
        return "send $1=255: motors that let go lose steps between moves"
    return ""


def was_tested(rig: RigModel | None) -> bool:
    """Return whether somebody saw which way the stage goes."""
    measured = rig.stage.measured if rig else None
    return measured is not None and bool(measured.direction_tested)


def _specimen(panel: Panel) -> dict[str, Any] | None:
    specimen = panel.workspace.files().specimen
    if specimen is None:
        return None
    return {
        "name": specimen.name,
        "side_mm": specimen.side_mm,
        "remanence_mT": specimen.remanence_mT,
        "density_kg_m3": specimen.density_kg_m3,
        "length_mm": [section.length_mm for section in specimen.sections],
        "E_MPa": [section.E_MPa for section in specimen.sections],
    }
