"""The Tesla-meter beside the model: a reading a second while somebody looks."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...core.errors import MagbendError
from ..workspace import Workspace
from .owner import BenchOwner
from .theory import model_flux_mT

EVERY_S = 1.0
NEAR_MM = 0.05
"""A reading holds for gaps no farther than this from its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One reading of the meter, where the stage stood."""

    status: str
    flux_mT: float | None
    gap_mm: float
    at_s: float


class FieldWatch:
    """The thread that reads the meter.

    Parameters
    ----------
    owner : BenchOwner
        Who holds the bench.
    workspace : Workspace
        Its files.
    changed : callable
        Told of a new reading.
    is_watched : callable
        Whether a page is open.
    """

    def __init__(
        self,
        owner: BenchOwner,
        workspace: Workspace,
        changed: Callable[[], None],
        is_watched: Callable[[], bool],
    ) -> None:
        self._owner, self._workspace = owner, workspace
        self._changed, self._is_watched = changed, is_watched
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._work, name="meter", daemon=True)
        self._reading: Reading | None = None
        self._trouble = ""

    def begin(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def flux_mT_at(self, gap_mm: float) -> float | None:
        """Return the flux density read at this gap, or None."""
        reading = self._reading
        if reading is None or abs(reading.gap_mm - gap_mm) > NEAR_MM:
            return None
        return reading.flux_mT

    def facts(self) -> dict[str, Any]:
        """Return the reading and the model's value, from any thread."""
        gap_mm = self._owner.gap_mm
        reading = self._reading
        return {
            "status": reading.status if reading else None,
            "flux_mT": reading.flux_mT if reading else None,
            "read_at_gap_mm": reading.gap_mm if reading else None,
            "age_s": time.monotonic() - reading.at_s if reading else None,
            "model_mT": self._model_mT(gap_mm),
            "trouble": self._trouble,
        }

    def _model_mT(self, gap_mm: float | None) -> float | None:
        files = self._workspace.files()
        magnet = files.rig.magnet if files.rig else None
        if gap_mm is None or gap_mm <= 0.0 or magnet is None or files.specimen is None:
            return None
        return model_flux_mT(magnet.magnet(), files.specimen.length_mm, gap_mm)

    def _work(self) -> None:
        while not self._ending.wait(EVERY_S):
            parts = self._owner.parts
            gap_mm = self._owner.gap_mm
            stands = not self._owner.view().doing
            watched = self._is_watched()
            if parts is None or parts.meter is None or gap_mm is None:
                self._reading = None
                continue
            if not (stands and watched):
                continue
            try:
                flux = parts.meter.read_flux(1, gap_mm=gap_mm)
            except MagbendError as error:
                self._trouble, self._reading = str(error), None
            else:
                self._trouble = ""
                self._reading = Reading(
                    status=flux.status, flux_mT=flux.flux_mT, gap_mm=gap_mm,
                    at_s=time.monotonic(),
                )  # fmt: skip
            self._changed()
