"""A Tesla-meter of one's own: a Hall sensor that prints ``x,y,z`` lines, all the time.

A package declares it, and a rig file names it:

    [project.entry-points."magbend.meters"]
    hall_xyz = "my_package:HallXyz"

    [meter]
    driver = "hall_xyz"
    port = "/dev/ttyUSB1"
    [meter.options]
    axis = [0.0, 1.0, 0.0]     # the sensor's direction that lies along the field
    mT_per_unit = 1e-3         # it prints microtesla

(For one number a line no code is needed: a description in TOML does.)
"""

from __future__ import annotations

import math
from typing import Any

import serial
from pydantic import BaseModel, Field

from magbend.core import MeterError
from magbend.rig import Check, Flux, MeterConfig, Sample, combine, go_on

STALE_LINES = 1
"""Lines thrown away after emptying the buffer: the first may be torn."""


class HallXyz:
    """The sensor, open on its port; `read_flux` takes lines that begin after the call.

    Parameters
    ----------
    config : MeterConfig
        Table ``[meter]`` of the rig file: port, sign, zero.
    options : HallXyz.Options
        Its ``[meter.options]``.
    """

    class Options(BaseModel):
        """The keys of ``[meter.options]``."""

        axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
        mT_per_unit: float = Field(default=1.0, gt=0.0)
        baud: int = Field(default=115200, gt=0)
        timeout_s: float = Field(default=1.0, gt=0.0)

    def __init__(self, config: MeterConfig, options: Options) -> None:
        length = math.hypot(*options.axis)
        if length == 0.0:
            raise MeterError("meter.options.axis must have a direction")
        self._axis = tuple(part / length for part in options.axis)
        self._config, self._options = config, options
        try:
            self._port = serial.serial_for_url(
                config.port, options.baud, timeout=options.timeout_s
            )
        except (OSError, ValueError) as error:
            raise MeterError(f"the port {config.port} does not open: {error}") from None

    @property
    def identity(self) -> dict[str, Any]:
        """What the run's record keeps."""
        return {
            "driver": "hall_xyz", "port": self._config.port, "unit": "mT",
            "zero_mT": self._config.zero_mT, **self._options.model_dump(),
        }  # fmt: skip

    def read_flux(self, samples: int, *, gap_mm: float, check: Check = go_on) -> Flux:
        """Return the flux density along the axis, from `samples` new lines."""
        del gap_mm
        self._port.reset_input_buffer()
        for _ in range(STALE_LINES):
            self._port.readline()
        taken = []
        for _ in range(samples):
            check()
            taken.append(self._sample(self._port.readline().decode("ascii", "replace")))
        return combine(taken, zero_mT=self._config.zero_mT, sign=self._config.sign)

    def _sample(self, line: str) -> Sample:
        if not line.endswith("\n"):
            return Sample(outcome="garbled" if line else "silent", raw=line)
        try:
            field = [float(word) for word in line.split(",")]
            along = math.fsum(a * b for a, b in zip(self._axis, field, strict=True))
        except ValueError:
            return Sample(outcome="garbled", raw=line.strip())
        if not math.isfinite(along):
            return Sample(outcome="overload", raw=line.strip())
        flux_mT = along * self._options.mT_per_unit
        return Sample(outcome="ok", flux_mT=flux_mT, raw=line.strip())

    def close(self) -> None:
        """Let the port go."""
        self._port.close()
