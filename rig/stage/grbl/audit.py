"""Does the board's ``$$`` fit the rig file? Pure: settings in, a sentence out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..config import StageConfig
from ..protocol import StageLimits

Settings = Mapping[str, str]
Range = tuple[float, float]

_AXES = "XYZ"
_MAX_STEPS_HZ = 30_000.0


def number(settings: Settings, name: str) -> float | None:
    """Return a setting as a number, or None if it is missing or is none."""
    try:
        value = float(settings[name])
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) else None


def audit(settings: Settings, config: StageConfig) -> str | None:
    """Return why the board does not fit the rig file, or None if it does.

    Parameters
    ----------
    settings : mapping
        ``$`` numbers without the dollar sign to values as text.
    config : StageConfig
        Table ``[stage]`` of the rig file.
    """
    for name, meaning, wanted in _expected(config):
        found = number(settings, name)
        if found is None:
            return f"the board does not report ${name} ({meaning})"
        if wanted is None:
            if found <= 0.0:
                return (
                    f"${name} ({meaning}) is {found:g}; it must be above zero: type "
                    f"${name}=... on the board's console, then connect again"
                )
        elif not math.isclose(found, wanted, rel_tol=1e-6, abs_tol=1e-9):
            return (
                f"${name} ({meaning}) is {found:g}, the rig file says {wanted:g}: type "
                f"${name}={wanted:g} on the board's console, or correct the rig file"
            )
    return _audit_flags(settings, config)


def _options(details: Sequence[str]) -> str:
    """Return the letters of ``[OPT:``."""
    options = next((d for d in details if d.startswith("OPT:")), "OPT:")
    return options[4:].split(",")[0]


def _homing_bits(settings: Settings) -> int:
    """Return ``$22``: 0 or 1 on GRBL; grblHAL adds 2, single axes, and 8, origin 0."""
    return int(number(settings, "22") or 0)


def audit_build(
    settings: Settings, details: Sequence[str], config: StageConfig
) -> str | None:
    """Return why the firmware's build cannot do what the rig file asks, or None.

    A stock GRBL that receives ``$HX`` answers ``error:3`` and stays stuck in Home.
    """
    options = _options(details)
    single = "H" in options or _homing_bits(settings) & 2
    if config.home_command != "$H" and not single:
        return (
            f"stage.home_command is {config.home_command}, but [OPT:{options}] says "
            "that this build has no single-axis homing; use $H, or a build that has it"
        )
    return None


def _expected(config: StageConfig) -> list[tuple[str, str, float | None]]:
    """List settings to look at: number, meaning, value wanted (None: above zero)."""
    axis, index = config.axis, _AXES.index(config.axis)
    rows: list[tuple[str, str, float | None]] = [
        (f"{100 + index}", f"steps/mm of {axis}", config.steps_per_mm),
        (f"{110 + index}", f"max. rate of {axis} in mm/min", config.max_feed_mm_min),
        (f"{120 + index}", f"acceleration of {axis} in mm/s2",
         config.acceleration_mm_s2),
        (f"{130 + index}", f"max. travel of {axis} in mm", config.travel_mm),
    ]  # fmt: skip
    named = [
        (name.lstrip("$"), "listed in the rig file", value)
        for name, value in config.settings.items()
    ]
    return rows + named


def _audit_flags(settings: Settings, config: StageConfig) -> str | None:
    if number(settings, "13"):
        return "$13 (report in inches) is 1; type $13=0 on the board's console"
    feed = number(settings, f"{110 + _AXES.index(config.axis)}")
    if feed is not None and config.feed_mm_min > feed:
        return (
            f"$11{_AXES.index(config.axis)} (max. rate of {config.axis}) is {feed:g} "
            f"mm/min, below stage.feed_mm_min = {config.feed_mm_min:g} of the rig file"
        )
    if config.homing == "switches" and not _homing_bits(settings) & 1:
        return (
            "$22 (homing) is off, so the stage cannot find its position: type $22=1 on "
            "the board's console (limit switches on every axis of a stock build), or "
            'write homing = "manual" in the rig file and use magbend rig set-gap'
        )
    return None


def notes(settings: Settings, config: StageConfig) -> list[str]:
    """Return what the board allows but a bench should not: sentences for people."""
    found = []
    if number(settings, "1") not in (None, 255.0):
        found.append(
            "$1 is not 255: the motors are switched off after each move and a rod or a "
            "magnet may pull the stage away; type $1=255"
        )
    if not number(settings, "20"):
        found.append("$20 (soft limits) is off; limits are checked by the host alone")
    if not number(settings, "21"):
        found.append(
            "$21 (hard limits) is off: a switch that closes on the way is seen by the "
            "host alone, a few tenths of a second late"
        )
    steps = number(settings, f"{100 + _AXES.index(config.axis)}") or 0.0
    rate_Hz = steps * config.feed_mm_min / 60.0
    if rate_Hz > _MAX_STEPS_HZ:
        found.append(
            f"feed_mm_min = {config.feed_mm_min:g} makes {rate_Hz:.0f} steps/s; an "
            f"8-bit board fails above {_MAX_STEPS_HZ:.0f} (ALARM:3, lost steps)"
        )
    return found


def limits_of(
    settings: Settings,
    details: Sequence[str],
    config: StageConfig,
    told_mm: Range | None = None,
) -> StageLimits:
    """Return step, ceilings and travel of the axis, after the audit passed.

    A GRBL that homes by switches counts from 0 at the upper switches into the negative,
    whichever side it homes to; one built (``Z`` in ``[OPT:``) or set to call the homed
    place 0 counts from there; `homed_at_mm` of the rig file, or a range that the board
    tells (`told_mm`), go before that. The last millimetres before the switch, over
    which homing pulls off, are left alone: a switch that closes there is an alarm.
    """
    index = _AXES.index(config.axis)
    steps, feed, acceleration, travel = (
        number(settings, f"{base + index}") or math.nan for base in (100, 110, 120, 130)
    )
    pull_off = number(settings, "27") or 0.0
    downward = int(number(settings, "23") or 0) >> index & 1
    limits = StageLimits(
        step_mm=1.0 / steps,
        max_feed_mm_min=feed,
        acceleration_mm_s2=acceleration,
    )
    homed = _homed_mm(settings, details, config, told_mm)
    if config.homing != "switches" or homed is None:
        return limits
    away = travel - pull_off
    switch, far = (-pull_off, away) if downward else (pull_off, -away)
    return replace(
        limits,
        travel_mm=_span(homed, homed + far),
        switch_mm=homed + switch,
        homed_mm=homed,
    )


def _homed_mm(
    settings: Settings,
    details: Sequence[str],
    config: StageConfig,
    told_mm: Range | None,
) -> float | None:
    """Return what the board counts after homing; None if nothing tells."""
    index = _AXES.index(config.axis)
    downward = int(number(settings, "23") or 0) >> index & 1
    if config.homed_at_mm is not None:
        return config.homed_at_mm
    if told_mm is not None:
        return told_mm[0] if downward else told_mm[1]
    if is_fluidnc(details):
        return None  # its configuration file says, and the board was silent
    if "Z" in _options(details) or _homing_bits(settings) & 8:
        return 0.0
    travel = number(settings, f"{130 + index}") or math.nan
    pull_off = number(settings, "27") or 0.0
    return pull_off - travel if downward else -pull_off


def is_fluidnc(details: Sequence[str]) -> bool:
    """Return whether the version names FluidNC: it keeps no ``$27`` and other rules."""
    return any("FluidNC" in text for text in details)


def _span(one: float, other: float) -> tuple[float, float]:
    return (one, other) if one < other else (other, one)


def homing_time_s(settings: Settings) -> float:
    """Return an upper bound of how long ``$H`` takes, in s.

    Search over 1.5 x the longest travel, then twice the pull-off and a slow locate
    over 5 x the pull-off, for the two groups (Z, then X and Y) of a stock build.
    """
    seek = (number(settings, "25") or 500.0) / 60.0
    locate = (number(settings, "24") or 25.0) / 60.0
    pull_off = number(settings, "27") or 1.0
    pause = 4.0 * (number(settings, "26") or 250.0) / 1000.0
    travel = max(number(settings, f"{name}") or 200.0 for name in (130, 131, 132))
    slowest = min(number(settings, f"{name}") or 10.0 for name in (120, 121, 122))
    ramps = 4.0 * seek / slowest
    group = 1.5 * travel / seek + 5.0 * pull_off / locate + 2.0 * pull_off / seek
    return 2.0 * (group + ramps + pause)
