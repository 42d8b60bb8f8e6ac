"""What a page may ask for, by name; each is what a command of ``magbend`` does too."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import TimeoutError as StillGoing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError, MagbendError, StageError
from .arguments import Arguments, Outcome, number
from .bench.parts import Parts, stage_of
from .photos import actions as photo_actions
from .runs import actions as run_actions
from .setup import actions as setup_actions
from .setup import gap

if TYPE_CHECKING:
    from .panel import Panel

ANSWER_S = 0.6
"""A move that is refused is refused within this time; one that goes on is shown."""

MOST_JOG_MM = 20.0
NUDGE_MM = 1.0
"""The longest jog of a stage that does not know where it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Caller:
    """The page that asks: its secret, and how it is named in the log."""

    client: str
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A command: what it does, and whether only the holder of the controls may ask."""

    do: Callable[[Panel, Arguments], Outcome]
    needs_controls: bool = True


def carry_out(panel: Panel, caller: Caller, name: str, arguments: Arguments) -> Outcome:
    """Do what a page asks, and log it with its source.

    Raises
    ------
    NotYoursError
        If another page holds the controls.
    MagbendError
        If it is refused or fails.
    """
    command = COMMANDS[name]
    try:
        if name in ("take", "release"):
            outcome = _controls(panel, caller, name, arguments)
        else:
            if command.needs_controls:
                panel.controls.require(caller.client, caller.name)
            outcome = command.do(panel, arguments)
    except MagbendError as error:
        panel.journal.write(caller.name, name, arguments, f"refused: {error}")
        raise
    finally:
        panel.hub.changed()
    panel.journal.write(caller.name, name, arguments, str(outcome.get("text", "done")))
    return {"ok": True, **outcome}


def _controls(panel: Panel, caller: Caller, name: str, arguments: Arguments) -> Outcome:
    if name == "release":
        panel.controls.release(caller.client)
        return {"text": "the controls are free"}
    over = arguments.get("over") is True
    before = panel.controls.take(caller.client, caller.name, over=over)
    return {"text": f"taken over from {before.name}" if before else "taken"}


def _stop(panel: Panel, _arguments: Arguments) -> Outcome:
    """Stop whatever moves: the run, else the stage."""
    if panel.supervisor.is_running:
        return {"text": panel.supervisor.stop()}
    panel.owner.request_stop()
    return {"text": "stopping"}


def _connect(panel: Panel, _arguments: Arguments) -> Outcome:
    panel.require_free()
    panel.owner.release()
    panel.sight.forget()
    return _wait(panel.owner.open(), "connecting")


def _home(panel: Panel, _arguments: Arguments) -> Outcome:
    panel.require_free()
    return _wait(
        panel.owner.submit("homing", lambda parts: stage_of(parts).home()), "homing"
    )


def _goto(panel: Panel, arguments: Arguments) -> Outcome:
    panel.require_free()
    gap_mm = number(arguments, "gap_mm", "mm")

    def act(parts: Parts) -> None:
        stage = stage_of(parts)
        stage.check_gap(gap_mm)
        stage.goto_gap(gap_mm, moved=panel.owner.moved)

    what = f"going to {gap_mm:.3f} mm"
    return _wait(panel.owner.submit(what, act, target_mm=gap_mm), what)


def _jog(panel: Panel, arguments: Arguments) -> Outcome:
    panel.require_free()
    step_mm = number(arguments, "step_mm", "mm")
    if not 0.0 < abs(step_mm) <= MOST_JOG_MM:
        raise InputError(
            f"a jog must be up to {MOST_JOG_MM:g} mm and not zero; instead received "
            f"{step_mm:g} mm: go to a gap for more"
        )
    here_mm = panel.owner.gap_mm
    target_mm = None if here_mm is None else here_mm + step_mm

    def act(parts: Parts) -> None:
        stage = stage_of(parts)
        status = stage.status()
        if status.gap_mm is not None and not status.doubt:
            stage.goto_gap(status.gap_mm + step_mm, moved=panel.owner.moved)
            return
        if status.state == "alarm":
            raise StageError("the stage is locked: home it, or unlock it")
        if abs(step_mm) > NUDGE_MM:
            raise StageError(
                f"where the stage is, is not known: home it, or jog by at most "
                f"{NUDGE_MM:g} mm and watch the rod"
            )
        stage.nudge(stage.place_map.direction * step_mm)

    return _wait(panel.owner.submit("jogging", act, target_mm=target_mm), "jogging")


def _recover(panel: Panel, _arguments: Arguments) -> Outcome:
    panel.require_free()
    return _wait(
        panel.owner.submit("recovering", lambda parts: stage_of(parts).recover()),
        "recovering",
    )


def _unlock(panel: Panel, arguments: Arguments) -> Outcome:
    panel.require_free()
    sure = arguments.get("confirm") is True
    return _wait(
        panel.owner.submit(
            "unlocking", lambda parts: stage_of(parts).unlock(confirm=sure)
        ),
        "unlocking",
    )


def _wait(future: Any, what: str) -> Outcome:
    """Return at once what is refused at once; a motion goes on by itself."""
    try:
        future.result(timeout=ANSWER_S)
    except StillGoing:
        return {"text": what, "going": True}
    return {"text": f"{what}: done"}


COMMANDS: dict[str, Command] = {
    "take": Command(do=lambda _panel, _arguments: {}, needs_controls=False),
    "release": Command(do=lambda _panel, _arguments: {}, needs_controls=False),
    "stop": Command(do=_stop, needs_controls=False),
    "connect": Command(do=_connect),
    "home": Command(do=_home),
    "goto": Command(do=_goto),
    "jog": Command(do=_jog),
    "recover": Command(do=_recover),
    "unlock": Command(do=_unlock),
    "plan-save": Command(do=run_actions.save_plan),
    "run-start": Command(do=run_actions.start_run),
    "run-pause": Command(do=run_actions.pause_run),
    "run-resume": Command(do=run_actions.resume_run),
    "run-abort": Command(do=run_actions.abort_run, needs_controls=False),
    "job": Command(do=run_actions.start_job),
    "point": Command(do=photo_actions.point_out),
    "design": Command(do=photo_actions.design_from),
    "setup-begin": Command(do=setup_actions.begin),
    "setup-rig": Command(do=setup_actions.set_rig),
    "setup-try-direction": Command(do=gap.try_direction),
    "setup-tell-direction": Command(do=gap.tell_direction),
    "setup-gap": Command(do=gap.set_gap),
    "setup-show-board": Command(do=setup_actions.show_board),
    "setup-take-board": Command(do=setup_actions.take_board),
    "setup-forget-board": Command(do=setup_actions.forget_board),
    "setup-calibrate": Command(do=setup_actions.calibrate),
    "setup-height": Command(do=setup_actions.set_height),
    "setup-zero": Command(do=setup_actions.zero_meter),
    "setup-scan": Command(do=setup_actions.scan_magnet),
    "setup-specimen": Command(do=setup_actions.set_specimen),
    "setup-done": Command(do=setup_actions.mark_step),
}
"""Every command by its name in the address of a POST."""
