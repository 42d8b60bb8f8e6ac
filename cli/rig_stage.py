"""``magbend rig``: the commands that speak with the stage alone."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import print_json, say
from .keys import terminating
from .rig_ask import (
    RIG,
    JsonOption,
    PortOption,
    RigOption,
    owner_facts,
    owner_screen,
    stage_table,
)
from .rig_ask import watch as watch_owner

if TYPE_CHECKING:
    from ..rig import GapStage

LogOption = Annotated[
    Path | None, typer.Option("--log", help="Append every byte to this file.")
]


def register(app: typer.Typer) -> None:
    """Add the commands of this module to the group ``rig``."""
    for name, command, example in (
        ("ports", ports, "ports"),
        ("status", status, "status --rig rig.toml"),
        ("home", home, "home --rig rig.toml"),
        ("goto", goto, "goto 60 --rig rig.toml"),
        ("jog", jog, "jog --rig rig.toml"),
        ("unlock", unlock, "unlock --rig rig.toml"),
        ("twin", twin, "twin --state board.json"),
    ):
        app.command(name, epilog=f"Example: magbend rig {example}")(command)


def ports(as_json: JsonOption = False) -> None:
    """List the serial ports of this machine."""
    import dataclasses

    from ..rig import list_ports

    found = list_ports()
    if as_json:
        print_json([dataclasses.asdict(port) for port in found])
        return
    if not found:
        say("no serial ports; is the cable in, and does it carry data?")
    for port in found:
        serial = f"serial:{port.serial_number}" if port.serial_number else "-"
        say(f"{port.device:<20} {port.usb_id or '-':<10} {serial:<24} "
                   f"{port.description}")  # fmt: skip


def status(
    rig: RigOption = RIG,
    port: PortOption = None,
    as_json: JsonOption = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Ask twice a second until Ctrl-C.")
    ] = False,
    log: LogOption = None,
) -> None:
    """Say where the stage is and how far it may go.

    Beside a run, or another command that holds the bench, say what that one does.
    """
    import time

    held = owner_facts(rig, port)
    if held is not None:
        if watch:
            watch_owner(rig, port, as_json)
        elif as_json:
            print_json(held)
        else:
            say(owner_screen(held))
        return
    with connected("status", rig, port, log) as stage:
        if not watch:
            data = facts(stage)
            print_json(data) if as_json else say(_screen(data))
            return
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                data = facts(stage)
                if as_json:
                    print_json(data)
                else:
                    say(line(data))
                if stage.stop_requested():
                    stage.hold()
                time.sleep(0.5)


def home(rig: RigOption = RIG, port: PortOption = None, log: LogOption = None) -> None:
    """Home the stage by its switches.

    A stock build homes Z first, then X and Y; Ctrl-C stops it at once.
    """
    with connected("home", rig, port, log) as stage:
        say("homing; Ctrl-C stops it at once", err=True)
        with _told_how_to_go_on(stage):
            stage.home()
        say(line(facts(stage)))


def goto(
    gap_mm: Annotated[float, typer.Argument(help="Gap in mm from the N face.")],
    rig: RigOption = RIG,
    port: PortOption = None,
    home_first: Annotated[
        bool, typer.Option("--home", help="Home first if the position is not known.")
    ] = False,
    feed_mm_min: Annotated[
        float | None, typer.Option(help="Speed instead of stage.feed_mm_min.")
    ] = None,
    as_json: JsonOption = False,
    log: LogOption = None,
) -> None:
    """Go to a gap, from the far side.

    Ctrl-C slows down and keeps the position.
    """
    import dataclasses

    with connected("goto", rig, port, log) as stage:
        stage.check_gap(gap_mm)
        if feed_mm_min is not None:
            stage.check_feed(feed_mm_min)
        with _told_how_to_go_on(stage):
            if home_first and stage.position_state != "homed":
                say("homing; Ctrl-C stops it at once", err=True)
                stage.home()
            record = stage.goto_gap(gap_mm, feed_mm_min=feed_mm_min, moved=_ticker())
        if as_json:
            print_json(dataclasses.asdict(record))
        else:
            say(
                f"gap {record.gap_mm:.3f} mm (machine {record.stage_mm:.3f} mm), "
                f"{record.duration_s:.1f} s, approached from the {record.approach}"
            )


def jog(rig: RigOption = RIG, port: PortOption = None, log: LogOption = None) -> None:
    """Move by keys, with the position on the screen.

    Arrows move, 1 to 5 choose the step, H homes, space stops, q quits.
    """
    from .jog_keys import jog_loop

    with connected("jog", rig, port, log) as stage:
        jog_loop(stage)


def unlock(
    rig: RigOption = RIG,
    port: PortOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    log: LogOption = None,
) -> None:
    """Lift an alarm without homing; asks first.

    This sends $X: the stage may not know where it is.
    """
    with connected("unlock", rig, port, log) as stage:
        before = stage.status()
        if before.state != "alarm":
            say(f"the stage is not locked; it is {before.state}")
            return
        sure = yes or typer.confirm(
            "The stage may not know where it is. Homing is safer. Unlock all the same?"
        )
        if not sure:
            say("still locked")
            return
        stage.unlock(confirm=True)
        say(line(facts(stage)))


def twin(
    state: Annotated[
        Path | None, typer.Option("--state", help="Keep settings and position here.")
    ] = None,
    board: Annotated[
        str, typer.Option(help="Which it plays: grbl, grblhal, fluidnc or marlin.")
    ] = "grbl",
) -> None:
    """Offer a virtual board on a pseudo-terminal.

    It ends with Ctrl-C; Linux and macOS only, elsewhere use --port twin://.
    """
    import time

    from ..rig import SystemClock
    from ..rig.virtual import PtyBoard, load_board, save_board

    played = load_board(state, board)
    with PtyBoard(played, SystemClock()) as served:
        say(served.port)
        with contextlib.suppress(KeyboardInterrupt), terminating():
            while True:
                time.sleep(3600.0)
    if state is not None:
        save_board(played, state)


_DOES = {"home": "homing", "goto": "moving", "jog": "jogging"}
"""What is told of a command that moves the stage while it holds the bench."""


@contextlib.contextmanager
def connected(
    command: str, rig: Path, port: str | None, log: Path | None
) -> Iterator[GapStage]:
    """Yield the stage, connected; whoever asks is told that `command` holds it."""
    from ..rig import (
        BenchState,
        GapStage,
        SystemClock,
        WireLog,
        make_stage,
        owning,
        read_rig,
        stopping,
    )

    config = stage_table(rig, port)
    bounds = read_rig(rig).limits
    clock = SystemClock()
    with contextlib.ExitStack() as opened:
        owner = opened.enter_context(
            owning(
                rig,
                config.port,
                BenchState(state=_DOES.get(command, "idle")),
                command=f"rig {command}",
            )
        )
        wire = WireLog(log, clock) if log else None
        if wire:
            opened.callback(wire.close)
        stage = GapStage(make_stage(config, clock, log=wire), config, bounds, clock)
        opened.callback(stage.close)
        owner.commands["stop"] = stopping(stage)
        opened.enter_context(terminating())
        stage.connect()
        yield stage


@contextlib.contextmanager
def _told_how_to_go_on(stage: GapStage) -> Iterator[None]:
    """Let Ctrl-C stop the stage, and say what its position is worth then."""
    from ..core.errors import RigError
    from ..rig import StoppedError, heed_interrupts

    with heed_interrupts(stage.request_stop) as received:
        try:
            with received.striking():
                yield
        except (KeyboardInterrupt, StoppedError) as stop:
            proof = stage.last_stop
            if not received.name or proof is None:
                raise RigError(str(stop) or "stopped; home it") from None
            raise RigError(f"stopped by {received.name}: {proof.sentence()}") from None


def facts(stage: GapStage) -> dict[str, Any]:
    """Return what the stage says of itself, for people and machines."""
    import dataclasses

    low, high = stage.range_mm()
    identity = stage.identity
    return {
        **dataclasses.asdict(stage.status()),
        "allowed_mm": [low, high],
        "port": identity.port,
        "firmware": identity.firmware,
        "notes": list(identity.notes),
    }


def _screen(data: dict[str, Any]) -> str:
    from ..rig import STOP_INPUTS

    gap = data["gap_mm"]
    machine = data["stage_mm"]
    low, high = data["allowed_mm"]
    where = "unknown" if gap is None else f"{gap:.3f} mm"
    counted = "-" if machine is None else f"{machine:.3f} mm"
    alarm = f" ALARM:{data['alarm']}" if data["alarm"] else ""
    rows = {
        "port": f"{data['port']}  {data['firmware']}",
        "state": f"{data['state']}{alarm}",
        "position": data["position_state"],
        "gap": f"{where}  (machine {counted})",
        "allowed": f"{low:g} to {high:g} mm",
        "switches": ", ".join(STOP_INPUTS.get(name, name) for name in data["pins"])
        or "none closed",
    }
    if data["state"] == "alarm":
        rows["to do"] = "home it (magbend rig home), or magbend rig unlock"
    elif data["doubt"]:
        rows["to do"] = data["doubt"]
    lines = [f"{name:<10}{text}" for name, text in rows.items()]
    return "\n".join(lines + [f"note      {note}" for note in data["notes"]])


def line(data: dict[str, Any]) -> str:
    """Return it in one line."""
    gap = data["gap_mm"]
    where = "gap unknown" if gap is None else f"gap {gap:.3f} mm"
    return f"{where}  {data['state']}  {data['position_state']}"


def _ticker() -> Any:
    """Return a callback that shows the gap on the way, where there is a terminal."""
    import sys

    if not sys.stderr.isatty():
        return None

    def show(gap_mm: float) -> None:
        typer.echo(f"\rgap {gap_mm:8.3f} mm ", nl=False, err=True)

    return show
