"""A base for stages of other makers: controllers that are asked where they are.

A driver says six things in its controller's words (`introduce`, `ask`, `begin`, `slow`,
`halt`, `seek_home`); trust, limits, short pieces, time-outs and the proof of a stop are
those of every stage. It is offered by an entry point of the group ``magbend.stages``,
with its own keys in ``[stage.options]``, checked by its class `Options`.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, NamedTuple

from pydantic import BaseModel

from ...core.errors import StageError
from ...core.toml import FileModel
from ..clock import Clock
from ..errors import NotStoppedError, StageTimeoutError, StoppedError
from ..link import Link
from ..wire_log import WireLog
from .config import StageConfig
from .protocol import Moved, StageIdentity, StageLimits, StageStatus
from .serial import MARGIN_S, SerialStage, stopped
from .stopping import MARGIN, Means, StopProof
from .trust import Place

_POLL_S = 0.05
_HOME_S = 120.0


class NoOptions(FileModel):
    """The keys of ``[stage.options]`` of a driver that has none."""


class Answer(NamedTuple):
    """What a controller says: its count of every axis in mm, and whether it moves."""

    places_mm: Place
    is_moving: bool
    restarts: int = 0


class _Polled:
    """The last answer, as `PositionTrust` wants it."""

    def __init__(self) -> None:
        self.restarts = 0
        self.last: Answer | None = None

    def machine(self) -> Place | None:
        return None if self.last is None else self.last.places_mm


class PolledStage(SerialStage[_Polled]):
    """One axis of a controller that answers where it is and whether it moves.

    Parameters
    ----------
    config : StageConfig
        Table ``[stage]`` of the rig file.
    options : pydantic.BaseModel
        Its ``[stage.options]``, of the class `Options`.
    clock : Clock
        Time.
    log : WireLog, optional
        Where every byte is recorded.

    Notes
    -----
    `axis_index` says which of the places is this stage's. No answer is a
    `StageTimeoutError` of the driver's own methods.
    """

    Options: ClassVar[type[BaseModel]] = NoOptions
    axis_index = 0

    def __init__(
        self,
        config: StageConfig,
        options: BaseModel,
        clock: Clock,
        *,
        log: WireLog | None = None,
    ) -> None:
        super().__init__(config, clock, log=log)
        self.options = options

    # --- what a driver says ---------------------------------------------------

    @abstractmethod
    def introduce(self, link: Link) -> tuple[StageIdentity, StageLimits]:
        """Find out who answers and what it is set to, or raise `StageError`."""

    @abstractmethod
    def ask(self, link: Link) -> Answer:
        """Ask where every axis is and whether one moves."""

    @abstractmethod
    def begin(self, link: Link, target_mm: float, feed_mm_min: float) -> None:
        """Begin an absolute move of this axis, in mm and mm/min."""

    @abstractmethod
    def slow(self, link: Link) -> None:
        """Begin to slow down, without losing steps."""

    @abstractmethod
    def halt(self, link: Link) -> None:
        """Stop at once; steps may be lost."""

    @abstractmethod
    def seek_home(self, link: Link) -> None:
        """Begin to seek the reference of this axis."""

    def no_answer(self, said: str) -> StageTimeoutError:
        """Return the error of a controller that does not answer."""
        return StageTimeoutError(
            f"the stage did not answer {said!r} within "
            f"{self._config.answer_timeout_s:.0f} s"
        )

    # --- what follows from it -------------------------------------------------

    def _meet(self, link: Link) -> _Polled:
        self._identity, self._limits = self.introduce(link)
        session = _Polled()
        self._session = session
        self._look()
        self._trust.watch(session)
        self._map_doubt, self._is_lent = "", False
        self._compare_with_measured()
        return session

    def _look(self) -> Answer:
        session = self._require_session()
        session.last = self.ask(self._require_link())
        session.restarts = session.last.restarts
        self._trust.note(session)
        return session.last

    def _here(self, answer: Answer) -> float:
        return answer.places_mm[self.axis_index]

    def home(self) -> None:
        """Seek the reference and wait until the stage stands there.

        Raises
        ------
        StageError
            If it has no switches, or does not come to a stand in time.
        """
        self._require_session()
        self._require_switches()
        self._trust.lose()
        with self._stand_if_interrupted(at_once=True):
            self.seek_home(self._require_link())
            self._await(self._config.home_timeout_s or _HOME_S, at_once=True)
        self._trust.confirm(self._require_session())

    def _await(self, limit_s: float, *, at_once: bool = False) -> Answer:
        """Wait until it stands; stop if that is asked for, or takes too long."""
        end_s = self._clock.monotonic_s() + limit_s
        while (answer := self._look()).is_moving:
            if self.stop_requested():
                raise StoppedError(stopped(self.stop() if at_once else self.hold()))
            if self._clock.monotonic_s() > end_s:
                how = self.stop().sentence()
                raise StageTimeoutError(
                    f"the stage still moves after {limit_s:.0f} s; {how}"
                )
            self._clock.sleep(_POLL_S)
        return answer

    def _standing_mm(self) -> float:
        answer = self._look()
        if answer.is_moving:
            raise StageError(
                "the stage moves; wait for it, or stop it first (magbend rig stop)"
            )
        return self._here(answer)

    def _ready_mm(self) -> float:
        here = self._standing_mm()
        self._trust.require(self._require_session(), self.limits.tolerance_mm)
        return here

    def _move_piece(self, target_mm: float, feed_mm_min: float, moved: Moved) -> None:
        start = self._here(self._look())
        self.begin(self._require_link(), target_mm, feed_mm_min)
        here = self._here(self._await(self._limit_s(target_mm - start, feed_mm_min)))
        if abs(here - target_mm) > self.limits.tolerance_mm:
            self._trust.doubt()
            raise StageTimeoutError(
                f"the stage stopped at {here:.3f} mm instead of {target_mm:.3f} mm; "
                "home it (magbend rig home)"
            )
        self._trust.stands(self._require_session())
        moved(here)

    def status(self) -> StageStatus:
        """Ask the controller; no answer is the state ``silent``."""
        try:
            answer = self._look()
        except StageTimeoutError:
            return StageStatus(state="silent", position_state=self.position_state)
        return StageStatus(
            state="run" if answer.is_moving else "idle",
            machine_mm=self._here(answer),
            position_state=self.position_state,
        )

    def listen(self) -> None:
        """Ask, since such a controller says nothing by itself."""
        self._look()

    def hold(self) -> StopProof:
        """Slow down and prove the stand, or stop at once.

        Raises
        ------
        StageTimeoutError
            If it cannot be proved to stand.
        """
        start, start_s = self._look(), self._clock.monotonic_s()
        if not start.is_moving:
            return self._proved(
                StopProof(means="nothing", machine_mm=self._here(start))
            )
        self.slow(self._require_link())
        limit_s = MARGIN_S + self.limits.duration_s(0.0, self._config.feed_mm_min)
        answer = self._stand(limit_s)
        if answer is None:
            return self._stop_hard(("slowing down did not end",))
        run_out = abs(self._here(answer) - self._here(start))
        limit_mm = MARGIN * self.limits.stopping_mm(self._config.feed_mm_min)
        poll_mm = _POLL_S * self._config.feed_mm_min / 60.0
        if run_out > limit_mm + poll_mm + self.limits.tolerance_mm:
            return self._stop_hard((f"it ran on for {run_out:.2f} mm",))
        return self._proved(self._proof("feed hold", answer, start, start_s))

    def stop(self) -> StopProof:
        """Stop at once; the position is doubted if anything moved.

        Raises
        ------
        StageTimeoutError
            If it cannot be proved to stand.
        """
        return self._stop_hard(())

    def _stop_hard(self, tried: tuple[str, ...]) -> StopProof:
        start, start_s = self._look(), self._clock.monotonic_s()
        self._trust.doubt()
        self._cry_stop()
        answer = self._stand(MARGIN_S)
        if answer is None:
            self._stop_is_met()
            raise NotStoppedError(
                "the stage could not be proved to stand: cut the power of its motors"
            )
        proof = self._proof("reset", answer, start, start_s, tried=tried, kept=False)
        return self._proved(proof)

    def _stand(self, limit_s: float) -> Answer | None:
        """Return the second of two answers in a row that it stands at one place."""
        end_s, before = self._clock.monotonic_s() + limit_s, None
        while self._clock.monotonic_s() < end_s:
            answer = self._look()
            if not answer.is_moving and before == answer:
                return answer
            before = answer
            self._clock.sleep(_POLL_S)
        return None

    def _proof(
        self,
        means: Means,
        answer: Answer,
        start: Answer,
        start_s: float,
        *,
        tried: tuple[str, ...] = (),
        kept: bool = True,
    ) -> StopProof:
        return StopProof(
            means=means,
            tried=tried,
            stood_s=self._clock.monotonic_s() - start_s,
            machine_mm=self._here(answer),
            run_out_mm=abs(self._here(answer) - self._here(start)),
            is_place_kept=kept,
        )

    def _proved(self, proof: StopProof) -> StopProof:
        self.last_stop = proof
        self._trust.stands(self._require_session())
        self._stop_is_met()
        return proof

    def _cry_stop(self) -> None:
        self.halt(self._require_link())

    def recover(self) -> None:
        """Connect again; the stage must be homed then."""
        self.connect()

    def unlock(self) -> None:
        """Connect again."""
        self.connect()
