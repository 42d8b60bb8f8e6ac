"""Commands of the guided path: each writes a file that the command line reads too."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ...core.checks import finite, positive
from ...core.errors import ConfigError, InputError, RigError
from ..arguments import Arguments, Outcome, number
from ..toml_edit import change
from ..workspace import now_name, require, utc_now
from . import board
from .steps import RIG_KEYS, STEPS, mark

if TYPE_CHECKING:
    from ..panel import Panel

_REOPENS = ("stage", "limits", "camera", "meter", "magnet", "bench")
LINE_MM = 50.0
"""Length of the line that is printed below the board, to measure the print by."""

MOST_ZERO_MT = 5.0
"""What a meter may be off at zero field; more is a field."""


def begin(panel: Panel, arguments: Arguments) -> Outcome:
    """Write the commented files of a new bench; overwrite nothing."""
    from ...rig import write_templates

    written = write_templates(
        panel.workspace.folder, twin=arguments.get("twin") is True
    )
    panel.connect()
    return {"text": f"written: {', '.join(path.name for path in written)}"}


def set_rig(panel: Panel, arguments: Arguments) -> Outcome:
    """Write values into the rig file, if it can be read with them, and reconnect."""
    from ...rig import read_rig

    values = arguments.get("values")
    if not isinstance(values, dict) or not values:
        raise InputError("values must be an object of keys of the rig file")
    for name in values:
        if name not in RIG_KEYS:
            raise InputError(
                f"the set-up knows {', '.join(RIG_KEYS)}; instead received {name!r}"
            )
    named = {RIG_KEYS[name]: value for name, value in values.items()}
    panel.require_free()
    change(panel.workspace.rig_path, named, read_rig)
    if any(path[0] in _REOPENS for path in named):
        panel.owner.release()
        panel.connect()
    return {"text": f"{panel.workspace.rig_path.name} written"}


def show_board(panel: Panel, arguments: Arguments) -> Outcome:
    """Lay the board under the computed bench's camera, or take it away."""
    parts = panel.owner.parts
    if parts is None or parts.twin is None:
        raise RigError("this is a real bench: lay the board there by hand")
    parts.twin.shows_board = arguments.get("shows") is True
    return {"text": "the board is " + ("there" if parts.twin.shows_board else "gone")}


def take_board(panel: Panel, arguments: Arguments) -> Outcome:
    """Keep a picture of the board."""
    return {"text": f"{board.take(panel, str(arguments.get('kind')))} kept"}


def forget_board(panel: Panel, _arguments: Arguments) -> Outcome:
    """Delete the pictures of the board."""
    board.forget(panel)
    return {"text": "begin anew"}


def calibrate(panel: Panel, arguments: Arguments) -> Outcome:
    """Calibrate the camera from the pictures of the board."""
    measured_mm = arguments.get("line_mm")
    scale = 1.0
    if measured_mm is not None:
        scale = positive(number(arguments, "line_mm", "mm"), "line_mm", "mm") / LINE_MM
    calibration = panel.workspace.files().calibration
    height_mm = calibration.rod_height_mm if calibration else None
    return board.calibrate(panel, rod_height_mm=height_mm, print_scale=scale)


def set_height(panel: Panel, arguments: Arguments) -> Outcome:
    """Write the height of the rod's axis above the board into the calibration."""
    from ...vision import write_calibration

    height_mm = number(arguments, "rod_height_mm", "mm")
    if abs(height_mm) > 200.0:
        raise InputError(
            f"rod_height_mm must be within 200 mm of the board; instead received "
            f"{height_mm:g} mm"
        )
    files = panel.workspace.files()
    calibration = require(files.calibration, files.problems, "calibration")
    changed = replace(calibration, rod_height_mm=height_mm)
    write_calibration(changed, panel.workspace.calibration_path)
    _mark(panel, "height")
    return {"text": f"rod height {height_mm:g} mm"}


def zero_meter(panel: Panel, _arguments: Arguments) -> Outcome:
    """Take the meter's present reading for its zero, and write it."""
    parts, gap_mm = panel.owner.parts, panel.owner.gap_mm
    if parts is None or parts.meter is None:
        raise RigError("there is no Tesla-meter on a port; give its zero by hand")
    rig = require(panel.workspace.files().rig, {}, "rig")
    flux = parts.meter.read_flux(10, gap_mm=gap_mm or 0.0)
    if flux.flux_mT is None:
        raise RigError(f"the Tesla-meter says {flux.status}; look at cable and range")
    zero_mT = round(rig.meter.zero_mT + flux.flux_mT, 4)
    if abs(zero_mT) > MOST_ZERO_MT:
        raise RigError(
            f"a zero of {zero_mT:g} mT is too large to be one (up to {MOST_ZERO_MT:g} "
            "mT): put the probe into its zero chamber, far from the magnet"
        )
    return set_rig(panel, {"values": {"zero_mT": zero_mT}})


def scan_magnet(panel: Panel, arguments: Arguments) -> Outcome:
    """Queue a scan of the field along the stage: the probe stands for the rod."""
    panel.require_free()
    gaps = arguments.get("gaps_mm")
    command = [
        "rig", "scan-field", panel.workspace.plan_path.name, "--out",
        f"scans/{now_name()}",
    ]  # fmt: skip
    if isinstance(gaps, list) and gaps:
        numbers = [finite(gap, "gaps_mm", "mm") for gap in gaps]
        command += ["--gaps-mm", ",".join(f"{gap:g}" for gap in numbers)]
    if panel.is_twin:
        command += ["--seed", str(panel.twin.seed)]
    panel.owner.release()
    panel.jobs.add("scan-field", "", command, after=panel.connect)
    return {"text": "scanning the field"}


def set_specimen(panel: Panel, arguments: Arguments) -> Outcome:
    """Write the specimen file: a rod of Table 1, or one's own numbers."""
    import tomlkit

    from ...core.files import write_text
    from ...core.specimen_file import read_specimen
    from ..toml_edit import read_as

    data = specimen_data(arguments)
    text = f"# Written by the panel's set-up; lengths in mm.\n{tomlkit.dumps(data)}"
    specimen = read_as(panel.workspace.specimen_path, text, read_specimen)
    write_text(panel.workspace.specimen_path, text)
    _mark(panel, "specimen")
    if panel.is_twin:
        panel.owner.release()
        panel.connect()
    return {"text": f"specimen.toml: {specimen.name}"}


def specimen_data(arguments: Arguments) -> Outcome:
    """Return the content of a specimen file from what the page sends.

    Raises
    ------
    InputError
        If lengths and moduli do not belong together.
    """
    if "gmc" in arguments:
        from ...core.specimen_file import specimen_dict
        from ...sim import gmc

        data = dict(specimen_dict(gmc(arguments["gmc"])))
    else:
        lengths, moduli = arguments.get("length_mm"), arguments.get("E_MPa")
        if not isinstance(lengths, list) or not isinstance(moduli, list):
            raise InputError("length_mm and E_MPa must be lists, root first")
        if len(lengths) != len(moduli) or not lengths:
            raise InputError(
                f"every section needs a length and a modulus; instead received "
                f"{len(lengths)} lengths and {len(moduli)} moduli"
            )
        data = {
            key: arguments[key]
            for key in ("name", "side_mm", "remanence_mT")
            if key in arguments
        }
        data["section"] = [
            {"length_mm": length, "E_MPa": modulus}
            for length, modulus in zip(lengths, moduli, strict=True)
        ]
    if arguments.get("density_kg_m3") is not None:
        data["density_kg_m3"] = arguments["density_kg_m3"]
    section = data.pop("section")
    return {**data, "section": section}  # tables go last in TOML


def mark_step(panel: Panel, arguments: Arguments) -> Outcome:
    """Note that a person has done a step."""
    step = str(arguments.get("step"))
    if step not in STEPS:
        raise InputError(f"the steps are {', '.join(STEPS)}; not {step!r}")
    _mark(panel, step)
    return {"text": "noted"}


def _mark(panel: Panel, step: str) -> None:
    if not panel.workspace.folder.is_dir():
        raise ConfigError(f"{panel.workspace.folder}: there is no such folder")
    mark(panel.workspace.folder, step, utc_now())
