"""What the stages on a serial port share, whatever dialect their board speaks.

Port and owner's note, limits, stop requests, and motion in short pieces: boards have no
watchdog, so a stage whose host dies runs on for one piece at most.
"""

from __future__ import annotations

import contextlib
import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Generic, TypeVar

from ...core.checks import finite
from ...core.errors import StageError
from ..clock import Clock
from ..errors import InterlockError, PositionLostError, StoppedError
from ..interrupts import StopAtOnce
from ..link import Link
from ..ports import resolve_port
from ..wire_log import WireLog
from .config import StageConfig
from .place import PlaceMap, difference, firmware_name, settings_that_matter
from .presence import Presence
from .protocol import GapMap, Moved, PositionState, StageIdentity, StageLimits, unheard
from .stopping import StopProof
from .trust import Counting, PositionTrust

logger = logging.getLogger(__name__)

MARGIN_S = 5.0
NUDGE_MM = 1.0
NUDGE_FEED_MM_MIN = 60.0


def stopped(proof: StopProof) -> str:
    """Return the sentence of a stop that somebody asked for."""
    asked = "the stage was stopped by magbend rig stop, a key or Ctrl-C"
    return f"{asked}: {proof.sentence()}"


Session = TypeVar("Session", bound=Counting)


class SerialStage(ABC, Generic[Session]):
    """One axis of a board; a dialect says how to meet, move and stop it.

    Parameters
    ----------
    config : StageConfig
        Table ``[stage]`` of the rig file.
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
        self._session: Session | None = None
        self._presence: Presence | None = None
        self._identity: StageIdentity | None = None
        self._limits: StageLimits | None = None
        self._trust = PositionTrust(
            "say where it stands first (magbend rig set-gap GAP)"
            if config.homing == "manual"
            else "home it first (magbend rig home)"
        )
        self._map_doubt = ""
        self._is_lent = False  # the map holds for one run only
        self._is_stop_asked = False  # no Event: its lock may be held under a signal
        self._is_under_way = False
        self.last_stop: StopProof | None = None

    @property
    def position_state(self) -> PositionState:
        """How far the position can be trusted."""
        if self._map_doubt and self._trust.state == "homed":
            return "unverified"
        return self._trust.state

    @property
    def doubt(self) -> str:
        """Why the position is not trusted, and the way out; empty if it is."""
        if self._trust.state != "homed":
            return str(self._trust.refusal())
        return self._map_doubt

    @property
    def place_map(self) -> PlaceMap:
        """The map by which the board's count is a gap, with all that it rests on."""
        config, identity = self._config, self.identity
        return PlaceMap(
            gap_at_zero_mm=config.gap_at_zero_mm,
            direction=config.direction,
            axis=config.axis,
            step_mm=self.limits.step_mm,
            travel_mm=self.limits.travel_mm,
            firmware=firmware_name(identity.firmware, identity.details),
            settings=settings_that_matter(identity.settings, config.axis),
        )

    @property
    def identity(self) -> StageIdentity:
        """Who answers, with all settings."""
        if self._identity is None:
            raise StageError("the stage is not connected")
        return self._identity

    @property
    def limits(self) -> StageLimits:
        """What the board is set to."""
        if self._limits is None:
            raise StageError("the stage is not connected")
        return self._limits

    # --- what a dialect says --------------------------------------------------

    @abstractmethod
    def _meet(self, link: Link) -> Session:
        """Identify and audit the board; note its identity, limits and trust."""

    @abstractmethod
    def _standing_mm(self) -> float:
        """Return where the board counts itself, standing.

        Raises
        ------
        StageError
            If it moves, or does not say where it is.
        """

    @abstractmethod
    def _ready_mm(self) -> float:
        """Bring the board to where it takes a motion; return where it stands.

        Raises
        ------
        StageError
            If it may not move: it moves already, is locked, or is not homed.
        """

    @abstractmethod
    def _move_piece(self, target_mm: float, feed_mm_min: float, moved: Moved) -> None:
        """Go there, a short way, and return when the stage stands there."""

    @abstractmethod
    def listen(self) -> None:
        """Take in what the board says unasked; raise if it lost its position."""

    @abstractmethod
    def hold(self) -> StopProof:
        """Bring to a stand what moves, prove it, and forget the rest."""

    @abstractmethod
    def stop(self) -> StopProof:
        """Stop at once, and prove it; what was moving has lost steps."""

    @abstractmethod
    def _cry_stop(self) -> None:
        """Send what stops the board at once, and wait for nothing."""

    # --- port -----------------------------------------------------------------

    def connect(self) -> None:
        """Open the port, find out who answers, refuse what does not fit.

        Raises
        ------
        StageError
            If the port cannot be opened, nobody answers in this dialect, or a setting
            does not fit the rig file: the sentence names the setting.
        """
        config = self._config
        self._let_go()
        self._trust.lose()
        port = resolve_port(config.address)
        link = Link(
            port, baud=config.baud, clock=self._clock, log=self._log, dtr=config.dtr
        )
        link.open()
        self._link, self._presence = link, Presence(port)
        self._is_stop_asked = False
        try:
            self._session = self._meet(link)
        except BaseException:
            self._let_go()
            raise

    def close(self) -> None:
        """Let go of the port."""
        self._let_go()

    def _let_go(self) -> None:
        if self._link:
            self._link.close()
        self._link = self._session = self._presence = None
        self._is_stop_asked = False

    def _require_session(self) -> Session:
        if self._session is None:
            raise StageError("the stage is not connected")
        return self._session

    def _require_link(self) -> Link:
        if self._link is None:
            raise StageError("the stage is not connected")
        return self._link

    # --- stop requests --------------------------------------------------------

    def stop_requested(self) -> bool:
        """Return whether somebody asks this process to stop the stage."""
        return self._is_stop_asked

    def request_stop(self) -> None:
        """Ask the thread that moves the stage to hold; safe from any thread."""
        self._is_stop_asked = self._link is not None

    def _stop_is_met(self) -> None:
        self._is_stop_asked = False

    def _hold_if_asked(self) -> None:
        if self.stop_requested():
            raise StoppedError(stopped(self.hold()))

    @contextlib.contextmanager
    def _stand_if_interrupted(self, *, at_once: bool = False) -> Iterator[None]:
        """On Ctrl-C hold first, so that the position stays; a second one stops.

        `at_once` is for homing, which has no position to keep.
        """
        try:
            yield
        except KeyboardInterrupt as interrupt:
            at_once = at_once or isinstance(interrupt, StopAtOnce)
            try:
                self.stop() if at_once else self.hold()
            except KeyboardInterrupt:
                with contextlib.suppress(StageError):
                    self._cry_stop()
                self._trust.doubt()
            except StageError as error:
                logger.warning("stage: %s", error)
            raise

    # --- position and motion --------------------------------------------------

    def assume_homed(
        self, machine_mm: float, map_: GapMap, *, for_run: bool = False
    ) -> None:
        """Take the operator's word for the place, and for the map there.

        Parameters
        ----------
        machine_mm : float
            What the board counts.
        map_ : tuple
            `gap_at_zero_mm` and `direction` from here on.
        for_run : bool
            The word holds for this connection; the next one does not trust it.

        Raises
        ------
        StageError
            If the stage does not stand, counts otherwise, or has switches and was not
            homed by them.
        """
        here = self._standing_mm()
        if abs(here - machine_mm) > self.limits.tolerance_mm:
            raise StageError(
                f"the board counts {here:.3f} mm, not {machine_mm:.3f} mm: it moved"
            )
        if self._config.homing == "switches" and self._trust.state != "homed":
            raise PositionLostError(
                f"the position of the stage is {self._trust.state}; it has switches: "
                "home it first (magbend rig home)"
            )
        gap_at_zero_mm, direction = map_
        self._config = self._config.model_copy(
            update={"gap_at_zero_mm": gap_at_zero_mm, "direction": direction}
        )
        self._is_lent, self._map_doubt = for_run, ""
        self._trust.confirm(self._require_session())

    def _compare_with_measured(self) -> None:
        """Doubt the map if the board is not as it was when the gap was measured."""
        measured = self._config.measured
        if measured is None:
            return
        then = {"firmware": measured.firmware, "settings": measured.settings}
        change = difference(then, self.place_map.as_dict())
        if change:
            self._map_doubt = (
                f"the gap was measured on another board: {change}; undo that, or "
                "measure the gap again (magbend rig set-gap GAP)"
            )

    def _require_switches(self) -> None:
        if self._config.homing != "switches":
            raise StageError(
                'the rig file says homing = "manual": bring the stage to a known gap '
                "and say which: magbend rig set-gap GAP"
            )

    def move_to(
        self, machine_mm: float, *, feed_mm_min: float, moved: Moved = unheard
    ) -> None:
        """Go there in pieces and return when the stage stands there.

        Raises
        ------
        PositionLostError
            If the stage is not homed, or the board restarted.
        InterlockError
            If the target lies outside the travel; nothing was sent.
        AlarmError, StageTimeoutError, LinkLostError, StoppedError
            As they say; the stage stands, or finishes one short piece.
        """
        self._require_session()
        self._check_travel(machine_mm)
        if self._map_doubt:
            raise PositionLostError(self._map_doubt)
        here = self._ready_mm()
        distance = machine_mm - here
        if abs(distance) <= self.limits.step_mm / 2.0:
            return
        pieces = math.ceil(abs(distance) / self._longest_piece_mm(feed_mm_min))
        self._is_under_way = True
        try:
            with self._stand_if_interrupted():
                for piece in range(1, pieces + 1):
                    self._hold_if_asked()
                    target = here + distance * piece / pieces
                    self._move_piece(target, feed_mm_min, moved)
        finally:
            self._is_under_way = False

    def nudge(self, distance_mm: float) -> None:
        """Go a short way slowly, from wherever the stage is.

        Raises
        ------
        InterlockError
            If it is more than `NUDGE_MM`, or a homed stage would leave its travel;
            nothing was sent.
        StageError
            If the board moves already, is locked, or the way did not end as it should.
        """
        finite(distance_mm, "distance_mm", "mm")
        if abs(distance_mm) > NUDGE_MM:
            raise InterlockError(
                f"a stage that does not know where it is moves at most {NUDGE_MM:g} mm "
                f"at a time; instead received {distance_mm:g} mm; nothing was sent"
            )
        here = self._standing_mm()
        if self._trust.state == "homed":
            self._check_travel(here + distance_mm)
        self._is_under_way = True
        try:
            with self._stand_if_interrupted():
                self._hold_if_asked()
                feed = min(self._config.feed_mm_min, NUDGE_FEED_MM_MIN)
                self._move_piece(here + distance_mm, feed, unheard)
        finally:
            self._is_under_way = False

    def _longest_piece_mm(self, feed_mm_min: float) -> float:
        """Return how far one motion may go, in mm."""
        del feed_mm_min
        return self._config.piece_mm

    def _check_travel(self, machine_mm: float) -> None:
        travel = self.limits.travel_mm
        slack = self.limits.step_mm / 2.0
        if travel and not travel[0] - slack <= machine_mm <= travel[1] + slack:
            raise InterlockError(
                f"machine position must be from {travel[0]:g} to {travel[1]:g} mm; "
                f"instead received {machine_mm:g} mm; nothing was sent"
            )

    def _limit_s(self, distance_mm: float, feed_mm_min: float) -> float:
        """Return how long a motion may take, on a board that is busy, in s."""
        usual_s = self.limits.duration_s(distance_mm, feed_mm_min)
        return MARGIN_S + self._config.busy_factor * usual_s
