"""``magbend panel``: the bench on one local page."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import typer

from ..core.errors import MissingExtraError
from .console import say
from .keys import terminating

EXAMPLE = "Example: magbend panel --rig rig.toml"


def panel(
    rig: Path = typer.Option(
        Path("rig.toml"), "--rig", help="The rig file; the page helps to write one."
    ),
    port: int = typer.Option(8765, "--port", help="Port of the page; 0: any."),
    host: str = typer.Option(
        "127.0.0.1",
        "--host",
        help="Address to listen on; beyond this machine's own "
        "loopback the page asks for a token.",
    ),
    name: list[str] = typer.Option(
        [],
        "--name",
        help="A name by which browsers reach it, such as a TLS proxy's.",
    ),
    no_browser: bool = typer.Option(
        False, "--no-browser", help="Print the address; open no browser."
    ),
    seed: int = typer.Option(
        1, "--seed", min=0, help="Which hidden truth the twin gets."
    ),
    speed: float = typer.Option(
        1.0, "--speed", help="How many times as fast as the wall's the twin's clock is."
    ),
) -> None:
    """Show the bench on a local page: live picture, theory over it, runs, set-up.

    The page calls what the command line calls. A run belongs to its own process:
    closing the page, or this command, does not stop it. Ctrl-C ends the panel.
    """
    open_panel(
        rig, host=host, port=port, names=tuple(name), browser=not no_browser,
        seed=seed, speed=speed,
    )  # fmt: skip


def open_panel(
    rig: Path, *, port: int, host: str = "127.0.0.1", names: tuple[str, ...] = (),
    browser: bool = True, seed: int = 1, speed: float = 1.0,
) -> None:  # fmt: skip
    """Serve the panel of a rig file until Ctrl-C."""
    with _extra():
        from ..panel import Address, Panel, Twin, Workspace, serve

        address = Address(host=host, port=port, names=names)
        shown = Panel(Workspace(rig), twin=Twin(seed=seed, speed=speed))
        with contextlib.suppress(KeyboardInterrupt), terminating():
            serve(shown, address, browser=browser, tell=say)


def open_demo(out: Path, *, seed: int, port: int, browser: bool) -> None:
    """Serve the panel of a computed bench that is calibrated and ready to run."""
    with _extra():
        from ..panel import prepare_demo

        rig = prepare_demo(out, seed=seed)
    say(f"{rig.parent}: a computed bench; home it, go to a gap, start the run")
    open_panel(rig, port=port, browser=browser, seed=seed, speed=3.0)


@contextlib.contextmanager
def _extra() -> Iterator[None]:
    """Turn a missing package of the panel into a sentence that names the extra."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "starlette").partition(".")[0]
        raise MissingExtraError(package, "panel", "the control panel") from None
