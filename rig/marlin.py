"""A board that speaks Marlin's dialect as a `Stage`; GRBL is the first choice.

Marlin cannot slow down on request without losing steps: a hold lets the short piece
that runs come to its end, a stop (``M410``) loses the position.
"""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Sequence

from ..core.errors import StageError
from .clock import Clock
from .link import Link, WireLog
from .marlin_session import MarlinSession, MarlinSetup, read_position, read_setup
from .ports import resolve_port
from .presence import Presence
from .stage import (
    InterlockError,
    LinkLostError,
    Moved,
    PositionLostError,
    PositionState,
    StageIdentity,
    StageLimits,
    StageStatus,
    StageTimeoutError,
    StoppedError,
    unheard,
)
from .stage_config import StageConfig

logger = logging.getLogger(__name__)

_MARGIN_S = 5.0
_HOME_S = 120.0


class MarlinStage:
    """One axis of a Marlin board.

    Parameters
    ----------
    config : StageConfig
        Table ``[stage]`` of the rig file, with ``driver = "marlin"``.
    clock : Clock
        Time.
    log : WireLog, optional
        Where every byte is recorded.
    """

    def __init__(
        self, config: StageConfig, clock: Clock, *, log: WireLog | None = None
    ) -> None:
        self._config = config
        self._clock = clock
        self._log = log
        self._link: Link | None = None
        self._session: MarlinSession | None = None
        self._presence: Presence | None = None
        self._setup: MarlinSetup | None = None
        self._identity: StageIdentity | None = None
        self._position: PositionState = "unknown"
        self._restarts = 0

    @property
    def position_state(self) -> PositionState:
        """How far the position can be trusted."""
        return self._position

    @property
    def identity(self) -> StageIdentity:
        """Who answers, with its settings."""
        if self._identity is None:
            raise StageError("the stage is not connected")
        return self._identity

    @property
    def limits(self) -> StageLimits:
        """What the board is set to."""
        if self._setup is None:
            raise StageError("the stage is not connected")
        return StageLimits(
            step_mm=1.0 / self._setup.steps_per_mm,
            max_feed_mm_min=60.0 * self._setup.max_feed_mm_s,
            acceleration_mm_s2=self._setup.acceleration_mm_s2,
            travel_mm=self._setup.travel_mm,
        )

    def connect(self) -> None:
        """Open the port, wait for the board to start, read and check its settings.

        Raises
        ------
        StageError
            If nobody answers as Marlin does, or a setting does not fit the rig file.
        """
        config = self._config
        self.close()
        self._position = "unknown"
        port = resolve_port(config.port)
        self._link = Link(
            port, baud=config.baud, clock=self._clock, log=self._log, dtr=config.dtr
        )
        self._link.open()
        self._presence = Presence(port)
        self._presence.claim()
        session = MarlinSession(
            self._link, self._clock, answer_timeout_s=config.answer_timeout_s
        )
        try:
            firmware, lines = _question(session, config.boot_s)
            setup = read_setup(lines, config.axis)
            problem = _audit(setup, config)
            if problem:
                raise StageError(f"the stage on {port} does not fit: {problem}")
        except BaseException:
            self.close()
            raise
        self._session, self._setup = session, setup
        self._restarts = session.restarts
        self._identity = StageIdentity(
            driver="marlin", firmware=firmware, port=port, details=tuple(lines)
        )

    def home(self) -> None:
        """Home this axis alone (``G28``) and wait for the end."""
        session = self._require_session()
        if self._config.homing != "switches":
            raise StageError(
                'the rig file says homing = "manual": bring the stage to a known gap '
                "and say which: magbend rig set-gap GAP"
            )
        self._position = "unknown"
        limit_s = self._config.home_timeout_s or _HOME_S
        for line in ("G21", "G90"):
            session.command(line)
        lines = session.command(
            f"G28 {self._config.axis}", timeout_s=limit_s, check=self._stop_homing
        )
        failed = next((text for text in lines if "fail" in text.lower()), None)
        if failed:
            raise StageError(f"homing failed: {failed}")
        self._position = "homed"

    def assume_homed(self, machine_mm: float) -> None:
        """Take the operator's word that the board's count is right."""
        here = self._machine_mm()
        if here is None or abs(here - machine_mm) > self.limits.step_mm:
            raise StageError(f"the board counts {here} mm, not {machine_mm:.3f} mm")
        if self._config.homing == "switches" and self._position != "homed":
            raise PositionLostError("the stage has switches: home it first")
        self._position = "homed"

    def move_to(
        self, machine_mm: float, *, feed_mm_min: float, moved: Moved = unheard
    ) -> None:
        """Go there in short pieces and return when the stage stands there."""
        session = self._require_session()
        travel = self.limits.travel_mm
        if travel and not travel[0] <= machine_mm <= travel[1]:
            raise InterlockError(
                f"machine position must be from {travel[0]:g} to {travel[1]:g} mm; "
                f"instead received {machine_mm:g} mm; nothing was sent"
            )
        self._notice_restart()
        if self._position != "homed":
            raise PositionLostError(
                f"the position of the stage is {self._position}; home it first"
            )
        here = self._machine_mm()
        if here is None:
            raise PositionLostError("the stage does not report its position; home it")
        distance = machine_mm - here
        pieces = math.ceil(abs(distance) / self._config.piece_mm)
        try:
            for piece in range(1, pieces + 1):
                self._check_stop()
                target = here + distance * piece / pieces
                self._move_piece(session, target, abs(distance) / pieces, feed_mm_min)
                moved(target)
        except KeyboardInterrupt:
            self._finish_piece()
            raise

    def status(self) -> StageStatus:
        """Ask for the position; no answer is the state ``silent``."""
        try:
            here = self._machine_mm()
        except LinkLostError:
            raise
        except StageError as error:
            self._notice_restart()
            lost = isinstance(error, PositionLostError)
            return StageStatus(
                state="alarm" if lost else "silent",
                position_state=self._position,
                trouble=error if lost else None,
            )
        self._notice_restart()
        return StageStatus(state="idle", machine_mm=here, position_state=self._position)

    def stop_requested(self) -> bool:
        """Return whether another process asks this one to stop the stage."""
        return self._presence is not None and self._presence.stop_asked()

    def request_stop(self) -> None:
        """Ask the thread that moves the stage to hold; safe from any thread."""
        if self._presence is not None:
            self._presence.ask_to_stop()

    def hold(self) -> None:
        """Let the short piece that runs come to its end; the position stays good."""
        self._finish_piece()

    def stop(self) -> None:
        """``M410``: stop at once, steps are lost."""
        if self._position == "homed":
            self._position = "unverified"
        self._require_session().command("M410")

    def recover(self) -> None:
        """Connect again; the stage must be homed then."""
        self.connect()

    def unlock(self) -> None:
        """Connect again: a halted Marlin must be restarted."""
        self.connect()

    def close(self) -> None:
        """Let go of the port."""
        if self._link:
            self._link.close()
        if self._presence:
            self._presence.release()
        self._link = self._session = self._presence = None

    def _move_piece(
        self, session: MarlinSession, target_mm: float, length_mm: float, feed: float
    ) -> None:
        limit_s = _MARGIN_S + self._config.busy_factor * self.limits.duration_s(
            length_mm, feed
        )
        axis = self._config.axis
        try:
            session.command(f"G1 {axis}{target_mm:.3f} F{feed:.1f}")
            session.command("M400", timeout_s=limit_s)
            here = self._machine_mm()
        except (StageTimeoutError, LinkLostError):
            self._position = "unverified"
            raise
        except PositionLostError:
            self._position = "unknown"
            raise
        if here is None or abs(here - target_mm) > 1.01 * self.limits.step_mm + 0.01:
            self._position = "unverified"
            raise StageTimeoutError(
                f"the stage stopped at {here} mm instead of {target_mm:.3f} mm"
            )

    def _finish_piece(self) -> None:
        session = self._require_session()
        if self._presence:
            self._presence.clear_stop()
        session.listen(0.2)
        limits, piece = self.limits, self._config.piece_mm
        limit_s = _MARGIN_S + self._config.busy_factor * limits.duration_s(
            piece, self._config.feed_mm_min
        )
        with contextlib.suppress(StageTimeoutError):
            session.command("M400", timeout_s=limit_s)
            return
        self.stop()
        raise StageTimeoutError("the stage did not come to a stop; home it")

    def _check_stop(self) -> None:
        if self.stop_requested():
            self._finish_piece()
            raise StoppedError("the stage was stopped by magbend rig stop")

    def _stop_homing(self) -> None:
        if self.stop_requested():
            self._require_link().write_realtime(b"M410\n")
            if self._presence:
                self._presence.clear_stop()
            raise StoppedError("homing was stopped by magbend rig stop; home it again")

    def _notice_restart(self) -> None:
        session = self._require_session()
        if session.restarts != self._restarts or session.halted:
            self._restarts = session.restarts
            self._position = "unknown"

    def _machine_mm(self) -> float | None:
        session, setup = self._require_session(), self._setup
        if setup is None:
            return None
        lines = session.command("M114")
        return read_position(lines, self._config.axis, setup.steps_per_mm)

    def _require_link(self) -> Link:
        if self._link is None:
            raise StageError("the stage is not connected")
        return self._link

    def _require_session(self) -> MarlinSession:
        if self._session is None:
            raise StageError("the stage is not connected")
        return self._session


def _question(session: MarlinSession, boot_s: float) -> tuple[str, list[str]]:
    """Wait for the board, then ask for firmware, settings and end stops."""
    session.listen(min(boot_s, 2.5))
    for attempt in range(3):
        try:
            lines = session.command("M115")
            break
        except StageTimeoutError:
            if attempt == 2:
                raise StageTimeoutError(
                    "nobody answers M115 as Marlin does: look at cable, port and baud"
                ) from None
    firmware = next((text for text in lines if "FIRMWARE_NAME" in text), "")
    if not firmware:
        raise StageError("the board answers, but not with Marlin's FIRMWARE_NAME")
    return firmware, session.command("M503") + session.command("M211")


def _audit(setup: MarlinSetup, config: StageConfig) -> str | None:
    rows: Sequence[tuple[str, float, float | None]] = (
        ("M92 (steps/mm)", setup.steps_per_mm, config.steps_per_mm),
        ("M203 (max. feed in mm/min)", 60.0 * setup.max_feed_mm_s,
         config.max_feed_mm_min),
        ("M201 (acceleration in mm/s2)", setup.acceleration_mm_s2,
         config.acceleration_mm_s2),
    )  # fmt: skip
    for name, found, wanted in rows:
        if wanted is not None and not math.isclose(found, wanted, rel_tol=1e-4):
            return f"{name} is {found:g}, the rig file says {wanted:g}"
    return None
