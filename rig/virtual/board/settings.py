"""The settings memory of the twin board: names, defaults, checks, and how it prints."""

from __future__ import annotations

from collections.abc import Mapping

from .dialect import Dialect

_INTEGERS = {0, 1, 2, 3, 4, 5, 6, 10, 13, 20, 21, 22, 23, 26, 30, 31, 32}
DEFAULTS: Mapping[int, float] = {
    0: 10, 1: 25, 2: 0, 3: 0, 4: 0, 5: 0, 6: 0, 10: 1, 11: 0.01, 12: 0.002, 13: 0,
    20: 0, 21: 0, 22: 0, 23: 0, 24: 25, 25: 500, 26: 250, 27: 1, 30: 1000, 31: 0, 32: 0,
    100: 250, 101: 250, 102: 250, 110: 500, 111: 500, 112: 500,
    120: 10, 121: 10, 122: 10, 130: 200, 131: 200, 132: 200,
}  # fmt: skip
OFFSET_ROWS = ("G54", "G55", "G56", "G57", "G58", "G59", "G28", "G30")


class Eeprom:
    """What survives a reset and a power cut.

    Attributes
    ----------
    values : dict
        Setting number to value.
    offsets : dict
        Rows G54 to G59, G28 and G30 to positions in mm.
    startup : list of str
        The two start-up lines ``$N0`` and ``$N1``.
    """

    def __init__(self, values: Mapping[int, float] | None = None) -> None:
        self.values: dict[int, float] = dict(DEFAULTS) | dict(values or {})
        self.offsets = {row: [0.0, 0.0, 0.0] for row in OFFSET_ROWS}
        self.startup = ["", ""]

    def __getitem__(self, number: int) -> float:
        return self.values[number]

    def flag(self, number: int) -> bool:
        """Return whether an on/off setting is on."""
        return bool(int(self.values[number]) & 1)

    def store(self, number: int, value: float) -> int:
        """Store a setting as the firmware does; return 0 or the error number."""
        if value < 0.0:
            return 4
        if number not in self.values:
            return 3
        if number == 0 and value < 3.0:
            return 6
        if number == 20 and value and not self.flag(22):
            return 10
        if number == 22 and not value:
            self.values[20] = 0
        whole = number in _INTEGERS
        self.values[number] = float(int(value) & 255) if whole else value
        if number in (30, 31):
            self.values[number] = value
        return 0

    def restore(self) -> None:
        """Go back to the defaults of the build."""
        self.values = dict(DEFAULTS)

    def lines(self, dialect: Dialect) -> list[str]:
        """Return the rows of ``$$``, as a firmware prints them."""
        shown = sorted(self.values.keys() - dialect.hidden)
        return [f"${n}={self._text(n, dialect.decimals)}" for n in shown]

    def _text(self, number: int, decimals: int) -> str:
        value = self.values[number]
        return f"{value:.0f}" if number in _INTEGERS else f"{value:.{decimals}f}"
