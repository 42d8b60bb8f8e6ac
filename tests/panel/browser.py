"""A headless Chromium of the system, watched for errors and foreign requests."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

SHOTS = Path("/tmp") / "magbend-panel-shots"
_ARGUMENTS = [
    "--no-sandbox", "--disable-gpu", "--disable-background-networking",
    "--disable-component-update", "--no-first-run", "--disable-dev-shm-usage",
]  # fmt: skip
SIZES = {
    "desktop": {"width": 1440, "height": 900},
    "phone": {"width": 390, "height": 844},
}


@dataclass
class Watch:
    """What went wrong in a page, and where it sent requests."""

    errors: list[str] = field(default_factory=list)
    hosts: set[str] = field(default_factory=set)


@contextlib.contextmanager
def launcher() -> Iterator[Callable[[], Any]]:
    """Yield what starts a browser; skip where there is none."""
    playwright = pytest.importorskip("playwright.sync_api")
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no Chromium on the PATH: the browser tests did not run")
    with playwright.sync_playwright() as running:
        yield lambda: running.chromium.launch(executable_path=path, args=_ARGUMENTS)


def open_page(
    browser: Any, url: str, *, size: str = "desktop", dark: bool = False
) -> tuple[Any, Watch]:
    """Open a page of its own context, and watch it."""
    context = browser.new_context(
        viewport=SIZES[size], color_scheme="dark" if dark else "light",
        has_touch=size == "phone",
    )  # fmt: skip
    page, watch = context.new_page(), Watch()
    page.set_default_timeout(30_000)
    page.on("pageerror", lambda error: watch.errors.append(str(error)))
    page.on(
        "console",
        lambda line: watch.errors.append(line.text) if line.type == "error" else None,
    )
    page.on("request", lambda sent: watch.hosts.add(urlsplit(sent.url).netloc))
    page.on("websocket", lambda sent: watch.hosts.add(urlsplit(sent.url).netloc))
    page.goto(url)
    return page, watch


def shoot(page: Any, name: str) -> None:
    """Keep a picture of the page, for whoever wants to look."""
    SHOTS.mkdir(exist_ok=True)
    page.screenshot(path=SHOTS / f"{name}.png")
