"""From the reply of a Tesla-meter to a typed sample: pure functions, no port."""

from __future__ import annotations

import math
import re

from ...core.errors import MeterError
from ...core.units import mT_from_T, tesla_per_unit
from .description import MeterDescription
from .protocol import Sample

_INSTRUMENT_INFINITY = 9.8e37
"""SCPI: 9.9E37 and beyond is infinity, which meters send when overloaded."""

_THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d*")
"""Points between thousands, which a decimal comma proves."""

_LONGEST = 256
"""Characters of a reply; a longer one is garbled, whatever it matches."""


def parse_reply(
    description: MeterDescription,
    reply: str,
    *,
    unit: str | None = None,
    multiplier: float = 1.0,
) -> Sample:
    """Return what a whole reply says.

    Parameters
    ----------
    description : MeterDescription
        Pattern, tokens, codes.
    reply : str
        One line or frame without its terminators.
    unit : str, optional
        The unit that was asked for, where the reply does not hold it.
    multiplier : float
        The prefix that was asked for, where the reply does not hold it.

    Returns
    -------
    Sample
        ``ok`` with the flux density in mT, ``overload``, or ``garbled``.
    """
    text = reply.strip()
    read = description.read
    if any(token and token.upper() in text.upper() for token in read.overload):
        return Sample(outcome="overload", raw=reply)
    match = re.fullmatch(read.pattern, text) if len(text) <= _LONGEST else None
    if match is None:
        return Sample(outcome="garbled", raw=reply)
    groups = {key: value or "" for key, value in match.groupdict().items()}
    if groups.get("status", "") in read.overload_status and groups.get("status"):
        return Sample(outcome="overload", raw=reply)
    try:
        value = _value(description, groups) * multiplier
        factor = _prefix(description, groups)
    except ValueError:
        return Sample(outcome="garbled", raw=reply)
    try:
        tesla = _tesla(description, groups, unit)
    except ValueError:
        return Sample(outcome="unit", raw=reply)
    if not math.isfinite(value) or abs(value) >= _INSTRUMENT_INFINITY:
        return Sample(outcome="overload", raw=reply)
    return Sample(outcome="ok", flux_mT=mT_from_T(value * factor * tesla), raw=reply)


def parse_unit(description: MeterDescription, reply: str) -> str:
    """Return the unit that the answer to the unit question means.

    Raises
    ------
    MeterError
        If it is none that is known: a reading without a unit is refused.
    """
    text = reply.strip().rstrip(";").strip()
    unit = description.unit.codes.get(text, text)
    try:
        tesla_per_unit(unit)
    except ValueError:
        raise MeterError(
            f"{description.name}: the unit of the readings must be known; instead the "
            f"meter answered {reply!r} to {description.unit.command!r}"
        ) from None
    return unit


def parse_multiplier(description: MeterDescription, reply: str) -> float:
    """Return the factor that the answer to the multiplier question means.

    Raises
    ------
    MeterError
        If it is none that is known.
    """
    factor = description.multiplier.codes.get(reply.strip())
    if factor is None:
        raise MeterError(
            f"{description.name}: the multiplier of the readings must be known; "
            f"instead the meter answered {reply!r} to "
            f"{description.multiplier.command!r}"
        )
    return factor


def _value(description: MeterDescription, groups: dict[str, str]) -> float:
    text = groups["value"].replace(" ", "")
    if description.read.decimal_comma:
        if "." in text and not _THOUSANDS.fullmatch(text):
            raise ValueError("a decimal point where commas are decimal")
        text = text.replace(".", "").replace(",", ".")
    value = float(text)
    if groups.get("decimals"):
        value /= 10.0 ** int(groups["decimals"])
    return -value if groups.get("sign", "") in description.read.negative else value


def _prefix(description: MeterDescription, groups: dict[str, str]) -> float:
    if "multiplier" not in groups:
        return 1.0
    factor = description.multiplier.codes.get(groups["multiplier"].strip())
    if factor is None:
        raise ValueError("unknown multiplier")
    return factor


def _tesla(
    description: MeterDescription, groups: dict[str, str], unit: str | None
) -> float:
    source = description.unit.source
    if source == "fixed":
        name = description.unit.name
    elif source == "reply":
        text = groups.get("unit", "")
        codes = description.unit.codes
        name = codes.get(text) if codes else text
    else:
        name = unit
    if name is None:
        raise ValueError("unknown unit")
    return tesla_per_unit(name)
