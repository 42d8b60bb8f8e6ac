"""What the commands share: groups, JSON for machines, progress for people."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from typing import Any

import typer

from ..core.json import dump_json
from ..core.progress import Progress
from ..core.text import printable, printable_json

JSON = typer.Option(False, "--json", help="Print JSON for a machine.")
"""The option of every command whose result a machine may read."""


def group(name: str, help_text: str, example: str) -> typer.Typer:
    """Return a command group with plain, fast help."""
    return typer.Typer(
        name=name,
        help=help_text,
        epilog=f"Example: {example}",
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )


def say(text: object = "", *, err: bool = False) -> None:
    """Print a line for people, without what a stranger's name would do to a terminal.

    Names of files and folders come from outside; every command speaks through here.
    """
    typer.echo(printable(str(text)), err=err)


def print_json(data: Any, *, indent: int | None = 2) -> None:
    """Print `data` as JSON; NaN becomes null, since JSON has no NaN."""
    typer.echo(printable_json(dump_json(data, indent=indent)))


@contextlib.contextmanager
def progress(what: str, *, kept: str = "", plain: bool = False) -> Iterator[Progress]:
    """Yield a callback that shows a bar with time left, or plain lines where no tty is.

    The bar goes to standard error, so that standard output stays for results. `kept` is
    what `main` says after Ctrl-C is left of the work. `plain` asks for lines also on a
    terminal: a bar that is drawn again and again wipes out what somebody types.
    """
    try:
        if sys.stderr.isatty() and not plain:
            with _bar(what) as callback:
                yield callback
        else:
            yield _PlainLines(what)
    except KeyboardInterrupt as stop:
        if kept:
            stop.add_note(kept)
        raise


@contextlib.contextmanager
def _bar(what: str) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import (
        Progress as RichProgress,
    )

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
        TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(),
    )  # fmt: skip
    with RichProgress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(what, total=None)

        def callback(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        yield callback


class _PlainLines:
    """Print a line at the end and, on long work, one every ten seconds.

    The time left is judged from the items alone: from when none was said to be done.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self._start = self._last = self._first = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if not done:
            self._first = now
        if done < total and now - self._last < 10.0:
            return
        self._last = now
        elapsed = now - self._start
        left = (now - self._first) * (total - done) / done if done else float("nan")
        remaining = f", {left:.0f} s left" if done and done < total else ""
        say(f"{self._what}: {done}/{total}, {elapsed:.0f} s{remaining}", err=True)
