"""Fifty pages at once, one too many, a page that says nonsense, a page that is slow."""

from __future__ import annotations

import contextlib
import json
import socket as socketlib
import time
from collections.abc import Iterator
from typing import Any

import pytest

from magbend.panel.hub import MOST_PAGES, dump

from .panel_server import Served

client = pytest.importorskip("websockets.sync.client")


@contextlib.contextmanager
def pages(panel: Served, count: int) -> Iterator[list[Any]]:
    """Open pages, and cut them off at the end as a pulled cable does."""
    with contextlib.ExitStack() as opened:
        found = []
        for number in range(count):
            page = client.connect(
                f"ws://{panel.netloc}/socket?client=page{number}",
                origin=f"http://{panel.netloc}", max_size=None,
            )  # fmt: skip
            found.append(opened.enter_context(page))
        yield found
        for page in found:
            with contextlib.suppress(OSError):
                page.socket.shutdown(socketlib.SHUT_RDWR)


def state(socket: Any) -> dict[str, Any]:
    """Return the next state that a page is told."""
    while True:
        message = socket.recv(timeout=10.0)
        if (
            isinstance(message, str)
            and (told := json.loads(message))["type"] == "state"
        ):
            return dict(told)


def test_fifty_pages_are_told_the_same_and_one_too_many_is_told_why(
    panel: Served,
) -> None:
    with pages(panel, 50) as fifty:
        assert {state(socket)["state"]["files"]["rig"] for socket in fifty} == {"bench"}
        with (
            pages(panel, MOST_PAGES - 50),
            pages(panel, 1) as (late,),
            pytest.raises(Exception, match="64 pages are open already"),
        ):
            late.recv(timeout=10.0)
        assert panel.command("stop")["ok"]
    deadline = time.monotonic() + 10.0
    while panel.panel.hub.pages:
        assert time.monotonic() < deadline


def test_a_page_hears_from_the_panel_every_second(panel: Served) -> None:
    with pages(panel, 1) as (socket,):
        first, deadline = state(socket)["state"]["beat"], time.monotonic() + 5.0
        while state(socket)["state"]["beat"] == first:
            assert time.monotonic() < deadline


@pytest.mark.parametrize("nonsense", ["", "{", "[]", "3", '{"picture": "yes"}', "{}"])
def test_nonsense_from_a_page_is_passed_over(panel: Served, nonsense: str) -> None:
    with pages(panel, 1) as (socket,):
        socket.send(nonsense)
        socket.send('{"command": "home"}')  # commands never come this way
        assert state(socket)["state"]["bench"]["doing"] == ""


def test_a_page_gets_the_next_picture_when_it_has_shown_the_last(panel: Served) -> None:
    with pages(panel, 1) as (socket,):
        socket.send('{"picture": true, "awake": true}')
        first = picture(socket)
        with pytest.raises(TimeoutError):
            picture(socket, timeout=0.6)  # it has not said that it has shown it
        socket.send(json.dumps({"shown": first["number"]}))
        assert picture(socket)["number"] > first["number"]


def test_pictures_come_again_after_the_bench_was_opened_anew(panel: Served) -> None:
    with pages(panel, 1) as (socket,):
        socket.send('{"picture": true, "awake": true}')
        before = picture(socket)["number"]
        panel.command("take", over=True)
        assert panel.command("connect")["ok"]
        socket.send(json.dumps({"shown": before}))
        assert picture(socket)["number"] > before
        socket.send(json.dumps({"shown": before + 1}))
        assert picture(socket)["number"] > before + 1


def picture(socket: Any, timeout: float = 10.0) -> dict[str, Any]:
    deadline = time.monotonic() + timeout
    while (left := deadline - time.monotonic()) > 0.0:
        message = socket.recv(timeout=left)
        if isinstance(message, bytes):
            length = int.from_bytes(message[:4], "big")
            assert message[4 + length :].startswith(b"\xff\xd8")
            return dict(json.loads(message[4 : 4 + length]))
    raise TimeoutError


def test_numbers_that_json_has_not_become_null() -> None:
    import numpy as np

    told = dump({"a": float("nan"), "b": [np.float64("inf"), np.arange(2)], 3: "é"})
    assert json.loads(told) == {"a": None, "b": [None, [0, 1]], "3": "é"}
