"""The panel: one bench, its owner thread, its eye, its runs, and who may command."""

from __future__ import annotations

import threading
import time
from typing import Any, Literal

from ..core.errors import CameraError, MagbendError, RigError
from .bench.field import FieldWatch
from .bench.owner import BenchOwner
from .bench.parts import Parts, Twin, is_twin, open_parts
from .bench.sight import Picture, Sight
from .bench.theory import Place, overlay, predict
from .controls import Controls
from .hub import Hub
from .journal import Journal
from .kernels import KernelWatch
from .runs.jobs import Jobs
from .runs.supervisor import Supervisor
from .state import compose
from .workspace import Workspace, utc_now


class Panel:
    """Everything behind the page; `serve` gives it an address.

    Parameters
    ----------
    workspace : Workspace
        The files of the bench.
    twin : Twin, optional
        How the computed bench is opened, if the rig file names it.

    Attributes
    ----------
    handing_over : Lock
        Held while the bench is taken, or given to a run: never both at once.
    direction : {1, -1} or None
        Which way somebody saw the stage go, in this sitting's test of the direction.
    """

    def __init__(self, workspace: Workspace, *, twin: Twin | None = None) -> None:
        self.workspace = workspace
        self.twin = twin or Twin()
        self.controls = Controls(utc_now)
        self.journal = Journal(workspace.folder, utc_now)
        self.hub = Hub(lambda: compose(self), self.controls)
        self.owner = BenchOwner(
            lambda: open_parts(
                workspace, self.twin, stop=lambda: self.owner.request_stop()
            ),
            self.hub.changed,
            lambda: self.hub.is_watched,
        )
        self.sight = Sight(
            self._grab, self._measure, self._pace_s, self.hub.show, self.hub.draw
        )
        self.field = FieldWatch(
            self.owner, workspace, self.hub.changed, lambda: self.hub.is_watched
        )
        self.kernels = KernelWatch(self.hub.changed)
        self.supervisor = Supervisor(workspace, self.hub.changed)
        self.supervisor.over = self.connect
        self.jobs = Jobs(workspace, self.hub.changed)
        self.handing_over = threading.Lock()
        self.direction: Literal[1, -1] | None = None
        self._number = 0
        self._seen: Parts | None = None
        self._after_s = 0.0
        self._last: Any = None
        self._pose: Any = None
        self._begun = threading.Event()

    def begin(self) -> None:
        """Start the threads and open the bench, if there is a rig file."""
        self._begun.set()
        self.supervisor.begin()
        self.owner.begin()
        self.sight.begin()
        self.field.begin()
        self.kernels.begin()
        self.connect()

    def connect(self) -> None:
        """Open the bench, unless there is no rig file or a run has it."""
        with self.handing_over:
            has_rig = self.workspace.files().rig is not None
            if has_rig and not self.supervisor.is_running:
                self.owner.open()

    def close(self) -> None:
        """Hold and let go of the bench; a run goes on in its own process."""
        if self._begun.is_set():
            self.supervisor.close()
            self.kernels.close()
            self.sight.close()
            self.field.close()
            self.owner.close()
            self.jobs.close()

    def require_free(self) -> None:
        """Refuse while a run has the bench.

        Raises
        ------
        RigError
            If one has.
        """
        if self.supervisor.is_running:
            raise RigError("a run has the bench; wait for its end, or abort it")

    @property
    def is_twin(self) -> bool:
        """Whether the bench is the computed one."""
        return is_twin(self.workspace)

    def _pace_s(self) -> float:
        is_moving = bool(self.owner.view().doing) or self.supervisor.is_running
        return self.hub.pace_s(is_moving=is_moving)

    def _grab(self) -> Picture | None:
        if self.supervisor.is_running:
            return self.supervisor.picture()
        parts = self.owner.parts
        if parts is None:
            return None
        if parts.camera is None:
            if "camera" in parts.problems:
                raise CameraError(parts.problems["camera"])
            return None
        return self._grab_here(parts)

    def _grab_here(self, parts: Parts) -> Picture:
        if parts is not self._seen:  # opened anew, with a clock of its own
            self._seen, self._after_s = parts, 0.0
        frame = parts.camera.grab_after(self._after_s)
        self._after_s = frame.arrival_s
        self._number += 1
        return Picture(
            image=frame.image, number=self._number, arrival_s=time.monotonic(),
            gap_mm=self.owner.gap_mm,
        )  # fmt: skip

    def _measure(self, picture: Picture) -> dict[str, Any]:
        from ..vision import Setting, as_photo, follow

        self.kernels.require()
        files = self.workspace.files()
        calibration = files.calibration
        size = picture.image.shape[1::-1]
        if calibration is not None and tuple(calibration.image_size_px) != tuple(size):
            calibration = None
        rod = files.specimen
        setting = Setting(
            calibration=calibration,
            joints_mm=rod.joints_mm if rod else (),
            length_mm=rod.length_mm if rod else None,
        )
        measured = follow(as_photo(picture.image), setting, self._last)
        self._last = measured
        if measured.pose is not None:
            self._pose = measured.pose
        predicted: dict[str, Any] = {}
        if picture.gap_mm is not None:
            place = Place(
                gap_mm=picture.gap_mm, flux_mT=self.field.flux_mT_at(picture.gap_mm)
            )
            predicted = predict(files, place)
        drawn = overlay(measured, calibration, predicted, self._pose)
        return {
            **drawn, "gap_mm": picture.gap_mm, "calibrated": calibration is not None
        }  # fmt: skip

    def snapshot(self) -> Picture:
        """Return the newest live picture.

        Raises
        ------
        MagbendError
            If there is none.
        """
        picture = self.sight.newest()
        if picture is None:
            raise MagbendError(
                "there is no live picture; look at the camera, and keep the page open"
            )
        return picture
