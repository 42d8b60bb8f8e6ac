"""``magbend``: the groups, and the one place where errors become sentences."""

from __future__ import annotations

import os
import sys

import typer

from ..core.errors import MagbendError
from . import analysis, bench, migrate, panel, rig, sim, vision
from .console import say
from .keys import Terminated, terminating

app = typer.Typer(
    name="magbend",
    help="Bend magnetic soft continuum rods: drive the bench, measure photographs, "
    "simulate, and report how far theory is from the bench.",
    epilog="Example: magbend demo --out demo",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.add_typer(rig.app, name="rig")
app.add_typer(vision.app, name="vision")
app.add_typer(sim.app, name="sim")
app.add_typer(analysis.app, name="analysis")
app.command("demo", epilog=bench.DEMO_EXAMPLE)(bench.demo)
app.command("panel", epilog=panel.EXAMPLE)(panel.panel)
app.command("migrate", epilog=migrate.EXAMPLE)(migrate.migrate)
app.command("doctor", epilog=bench.DOCTOR_EXAMPLE)(bench.doctor)
app.command("examples", epilog=bench.EXAMPLES_EXAMPLE)(bench.examples)
app.command("schema", epilog=bench.SCHEMA_EXAMPLE)(bench.schema)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        say(f"magbend {version('magbend')}")
        raise typer.Exit


@app.callback()
def options(
    debug: bool = typer.Option(False, "--debug", help="Show tracebacks of errors."),
    _version: bool = typer.Option(
        False,
        "--version",
        help="Print the version.",
        callback=_print_version,
        is_eager=True,
    ),
) -> None:
    """Options of every command."""
    if debug:
        os.environ["MAGBEND_DEBUG"] = "1"
        return
    # OpenCV and its FFmpeg tell of damaged files at length; ours is one sentence.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


INTERRUPTED = 130
TERMINATED = 143
"""Exit codes after Ctrl-C and SIGTERM, as of shells: 128 and the signal's number."""


def main() -> None:
    """Run the command line; a user's mistake ends in one sentence and exit code 1.

    Ctrl-C and SIGTERM end in one sentence too, and exit codes 130 and 143.
    """
    try:
        with terminating():
            app()
    except KeyboardInterrupt as stop:
        sys.exit(_say_interrupted(stop))
    except SystemExit as end:
        if end.code == INTERRUPTED:  # typer's, for a Ctrl-C within a command
            sys.exit(_say_interrupted(end))
        raise
    except MagbendError as error:
        _stop(error, str(error))
    except BrokenPipeError:
        # The reader of our output (head, less) is gone: nothing is left to say.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        name = f"{error.filename}: " if error.filename else ""
        reason = error.strerror or str(error)
        if isinstance(error, FileExistsError):
            reason = "is a file, not a folder; give another name"
        _stop(error, f"{name}{reason}")


def _say_interrupted(end: BaseException | None) -> int:
    """Say so, and what the interrupted command noted is kept; return the exit code."""
    while end is not None and not isinstance(end, KeyboardInterrupt):
        end = end.__cause__ or end.__context__
    notes = getattr(end, "__notes__", [])
    name, code = "Ctrl-C", INTERRUPTED
    if isinstance(end, Terminated):
        name, code = "SIGTERM", TERMINATED
    say("; ".join([f"magbend: stopped by {name}", *notes]), err=True)
    return code


def _stop(error: Exception, sentence: str) -> None:
    if os.environ.get("MAGBEND_DEBUG"):
        raise error
    say(f"magbend: {' '.join(sentence.split())}", err=True)
    sys.exit(1)


if __name__ == "__main__":
    main()
