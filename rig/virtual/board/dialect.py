"""The firmwares that the twin board can play, where they differ to its driver.

GRBL 1.1h is the recorded one. grblHAL and FluidNC were read in their sources and in
dialogues: what they answer to the questions of the driver, and to a stop.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Dialect:
    """How one firmware differs from GRBL 1.1h.

    Attributes
    ----------
    banner : str
        Its start-up line.
    details : tuple of str
        Its answer to ``$I``.
    holds_jogs : bool
        Whether a feed hold stops a jog.
    decimals : int
        Of the settings that are no whole numbers.
    hidden : frozenset of int
        Settings that it does not list.
    homed_mm : mapping of int to float
        Where an axis is counted after homing; GRBL's own rule where it is missing.
    counts_up : bool
        Whether the travel runs from 0 upward.
    """

    banner: str = "Grbl 1.1h ['$' for help]"
    details: tuple[str, ...] = ("[VER:1.1h.20190830:]", "[OPT:V,15,128]")
    holds_jogs: bool = True
    decimals: int = 3
    hidden: frozenset[int] = frozenset()
    homed_mm: Mapping[int, float] = field(default_factory=dict)
    counts_up: bool = False


GRBL = Dialect()

GRBLHAL = Dialect(
    banner="GrblHAL 1.1f ['$' or '$HELP' for help]",
    details=(
        "[VER:1.1f.20260817:]", "[OPT:VNML+,15,128,3,0]", "[AXS:3:XYZ]",
        "[NEWOPT:ENUMS,RT+,TC,SED]", "[FIRMWARE:grblHAL]", "[DRIVER:Simulator]",
    ),
    holds_jogs=False,
    decimals=5,
)  # fmt: skip

FLUIDNC = Dialect(
    banner="Grbl 3.7 [FluidNC v3.7.16 (wifi) '$' for help]",
    details=(
        "[VER:3.0 FluidNC v3.7.16 (esp32-wifi) :]", "[OPT:PHS]",
        "[MSG: Machine: bench]",
    ),
    homed_mm={0: 0.0, 1: 0.0, 2: 0.0},
    hidden=frozenset({0, 1, 2, 3, 4, 5, 6, 11, 12, 24, 25, 26, 27, 31}),
)  # fmt: skip

DIALECTS: Mapping[str, Dialect] = {
    "grbl": GRBL, "grblhal": GRBLHAL, "fluidnc": FLUIDNC,
}  # fmt: skip
"""The names by which a rig file or ``twin://?board=`` asks for them."""
