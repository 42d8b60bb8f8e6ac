"""``magbend rig stop|pause|resume|watch``: ask the process that owns the bench."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import print_json, say

if TYPE_CHECKING:
    from ..rig import StageConfig

RigOption = Annotated[Path, typer.Option("--rig", help="The rig file.")]
PortOption = Annotated[
    str | None, typer.Option("--port", help="Instead of stage.port of the rig file.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="For a machine.")]
RIG = Path("rig.toml")


def register(app: typer.Typer) -> None:
    """Add the commands of this module to the group ``rig``."""
    for command in (stop, pause, resume, watch):
        name = command.__name__
        app.command(name, epilog=f"Example: magbend rig {name} --rig rig.toml")(command)


def stop(rig: RigOption = RIG, port: PortOption = None) -> None:
    """Stop the stage, also from another terminal.

    A run or command that holds the bench is told, and holds the stage.
    """
    from ..rig import SystemClock, stop_from_outside

    say(stop_from_outside(rig, stage_table(rig, port), SystemClock()))


def pause(rig: RigOption = RIG, port: PortOption = None) -> None:
    """Pause the run that holds the bench, at its next safe point."""
    say(_ask(rig, port, "pause"))


def resume(rig: RigOption = RIG, port: PortOption = None) -> None:
    """Let a paused run go on.

    To go on with a run that ended, see magbend rig run --resume.
    """
    say(_ask(rig, port, "resume"))


def watch(
    rig: RigOption = RIG, port: PortOption = None, as_json: JsonOption = False
) -> None:
    """Follow what holds the bench, a line a change, until it is over.

    Ctrl-C ends the watching, not the run.
    """
    from ..rig import watch as states

    before = ""
    with contextlib.suppress(KeyboardInterrupt):
        for facts in states(rig, port=stage_table(rig, port).port):
            if as_json:
                print_json(facts, indent=None)
                continue
            line = owner_line(facts)
            if line != before:
                say(line)
            before = line


def stage_table(rig: Path, port: str | None) -> StageConfig:
    """Return the stage's table of a rig file, with another port if one is given."""
    from ..core.errors import ConfigError
    from ..rig import read_rig

    if not rig.exists():
        raise ConfigError(
            f"{rig}: there is no such file; name yours with --rig, or write one: "
            "magbend rig init"
        )
    config = read_rig(rig).stage
    return config.model_copy(update={"port": port}) if port else config


def owner_facts(rig: Path, port: str | None) -> dict[str, Any] | None:
    """Return what the process that holds the bench tells; None if nobody does."""
    from ..rig import NobodyError, ask

    try:
        return ask(rig, "status", port=stage_table(rig, port).port)
    except NobodyError:
        return None


def owner_screen(facts: dict[str, Any]) -> str:
    """Return what holds the bench and what it does, as lines for people."""
    who = f"magbend {facts['command']}, process {facts['pid']}"
    rows = {
        "held by": f"{who} ({facts['user']})" + ("  TWIN" if facts["twin"] else ""),
        "run": facts.get("folder", ""),
        "state": facts["state"],
        "step": _step(facts),
        "gap": _number(facts.get("gap_mm"), "{:.3f} mm"),
        "flux": _number(facts.get("flux_mT"), "{:.2f} mT"),
        "flags": ", ".join(facts.get("flags") or []),
        "time left": _minutes(facts.get("time_left_s")),
        "picture": facts.get("picture", ""),
        "said": facts.get("line", ""),
    }
    return "\n".join(f"{name:<11}{text}" for name, text in rows.items() if text)


def owner_line(facts: dict[str, Any]) -> str:
    """Return the same in one line; without the time left, which always changes."""
    parts = [
        facts["state"],
        _step(facts) and f"step {_step(facts)}",
        _number(facts.get("gap_mm"), "gap {:.3f} mm"),
        _number(facts.get("flux_mT"), "flux {:.2f} mT"),
        ", ".join(facts.get("flags") or []),
        facts.get("reason", "") if facts["state"] == "over" else "",
    ]
    return "  ".join(part for part in parts if part)


def _ask(rig: Path, port: str | None, what: str) -> str:
    from ..rig import ask

    return str(ask(rig, what, port=stage_table(rig, port).port)["text"])


def _step(facts: dict[str, Any]) -> str:
    step, steps = facts.get("step"), facts.get("steps")
    return f"{step} of {steps}" if step and steps else ""


def _number(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


def _minutes(time_s: float | None) -> str:
    if time_s is None:
        return ""
    minutes, seconds = divmod(round(time_s), 60)
    return f"{minutes} min {seconds:02d} s"
