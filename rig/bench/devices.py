"""The devices of one bench, open together and closed together."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from ...core.errors import MagbendError
from ..axes.line import Axis
from ..camera.protocol import Camera
from ..clock import Clock, utc_text
from ..meter.protocol import Meter
from ..stage.gap import GapStage
from ..wire_log import WireLog

logger = logging.getLogger(__name__)


class Closing(Protocol):
    """Whatever is let go at the end."""

    def close(self) -> None:
        """Let the port go."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Devices:
    """An open stage, camera and Tesla-meter, and the clock that they share.

    `log`, where there is one, waits for a folder that somebody owns; `axes` are what a
    plan scans beside the gap, by name.
    """

    stage: GapStage
    camera: Camera
    meter: Meter
    clock: Clock
    log: WireLog | None = None
    axes: Mapping[str, Axis] = field(default_factory=dict)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the devices do but a bench should not: sentences for people."""
        return (*self.stage.identity.notes, *self.camera.identity.get("notes", ()))

    def utc(self) -> str:
        """Return the UTC time of the bench's clock, ISO 8601 with milliseconds."""
        return utc_text(self.clock)

    def close(self) -> None:
        """Let every device go, also when one of them refuses."""
        every: list[Closing] = [self.camera, self.meter, self.stage]
        for device in [*every, *self.axes.values()]:
            try:
                device.close()
            except MagbendError as error:
                logger.warning("%s", error)


@contextlib.contextmanager
def closing_all(devices: Devices) -> Iterator[Devices]:
    """Close the devices at the end of a ``with`` block, however it ends."""
    try:
        yield devices
    finally:
        devices.close()
