"""A bench of the twin, and a panel that serves it, shared by the tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .panel_server import Served, served

pytest.importorskip("starlette", reason="the extra panel is not installed")
pytest.importorskip("uvicorn", reason="the extra panel is not installed")


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the rig file of a calibrated twin bench."""
    from magbend.panel import prepare_demo

    return prepare_demo(tmp_path_factory.mktemp("bench") / "bench", seed=2)


@pytest.fixture(scope="session")
def panel(bench: Path) -> Iterator[Served]:
    """Return a panel that serves the bench."""
    with served(bench) as server:
        yield server


@pytest.fixture(autouse=True)
def system_temp() -> Path:
    """Leave control sockets where they are: a panel and its runs outlive one test."""
    return Path("/tmp")
