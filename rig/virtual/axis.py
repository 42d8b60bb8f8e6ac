"""The twin's other axes: they are where they were sent."""

from __future__ import annotations

from typing import Any

from ...core.errors import RigError
from ..axes.config import AxisConfig, why_not_set
from ..clock import Check, Clock, go_on, wait


class VirtualAxis:
    """An axis without a device."""

    def __init__(self, config: AxisConfig, clock: Clock) -> None:
        self._config = config
        self._clock = clock
        self.value: float | None = None

    @property
    def identity(self) -> dict[str, Any]:
        """Return its table, and that it is the twin's."""
        return {**self._config.model_dump(mode="json"), "driver": "twin"}

    def set(self, value: float, *, check: Check = go_on) -> float:
        """Go to a value within its limits."""
        why = why_not_set(self._config, value)
        if why:
            raise RigError(f"{self._config.name} {why}; nothing was sent")
        wait(self._clock, self._config.settle_s, check)
        self.value = value
        return value

    def close(self) -> None:
        """Do nothing."""
