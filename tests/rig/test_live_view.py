from __future__ import annotations

import contextlib
import json
import socket
import struct
import time
import urllib.error
import urllib.request

import cv2
import numpy as np
import pytest

from magbend.core.errors import RigError
from magbend.rig.camera.live_view import LiveStatus, live_view
from magbend.rig.camera.protocol import Frame


class Eye:
    frame: Frame | None = None

    def newest(self) -> Frame | None:
        return self.frame


def get(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=5) as answer:
        return answer.read()


def test_the_page_shows_age_state_and_the_newest_picture() -> None:
    eye, status = Eye(), LiveStatus()
    with live_view(eye, status, lambda: 12.5) as address:
        assert address.startswith("http://127.0.0.1:")
        assert b"<img" in get(address)
        assert json.loads(get(address + "status.json"))["age_s"] is None
        with pytest.raises(urllib.error.HTTPError) as missing:
            get(address + "frame.jpg")
        missing.value.close()
        image = np.full((40, 60), 255, np.uint8)
        image[:20] = 100
        eye.frame = Frame(image=image, arrival_s=12.0, time_utc="", number=7)
        status.report("\apaused")
        state = json.loads(get(address + "status.json"))
        assert (state["line"], state["age_s"], state["number"]) == ("paused", 0.5, 7)
        assert state["saturated_percent"] == 50.0
        data = np.frombuffer(get(address + "frame.jpg"), np.uint8)
        assert cv2.imdecode(data, cv2.IMREAD_UNCHANGED).shape == (40, 60)
        port = int(address.rstrip("/").rpartition(":")[2])
        with (
            pytest.raises(RigError, match="cannot listen"),
            live_view(eye, status, lambda: 0.0, port=port),
        ):
            pass


def test_a_port_that_is_none_is_a_sentence() -> None:
    for port in (-1, 70_000, 10**9):
        with (
            pytest.raises(RigError, match="from 0 to 65535"),
            live_view(Eye(), LiveStatus(), lambda: 0.0, port=port),
        ):
            pass


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "127.0.0.1"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
    ],
)
def test_only_pages_of_this_address_are_answered(headers: dict[str, str]) -> None:
    with live_view(Eye(), LiveStatus(), lambda: 0.0) as address:
        asked = urllib.request.Request(address, headers=headers)
        with pytest.raises(urllib.error.HTTPError, match="403") as refused:
            urllib.request.urlopen(asked, timeout=5)
        refused.value.close()
        assert b"<img" in get(address)


def test_callers_that_hang_up_or_say_nothing_harm_nobody(capfd) -> None:
    eye = Eye()
    image = np.full((600, 800), 90, np.uint8)
    eye.frame = Frame(image=image, arrival_s=0.0, time_utc="", number=1)
    with live_view(eye, LiveStatus(), lambda: 0.0) as address:
        port = int(address.rstrip("/").rpartition(":")[2])
        silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(15)]
        for garbage in (b"", b"GET /frame.jpg", b"\x00\xff\r\n\r\n", b"GET " * 9000):
            with socket.create_connection(("127.0.0.1", port)) as caller:
                caller.setsockopt(
                    socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0)
                )
                with contextlib.suppress(OSError):
                    caller.sendall(garbage)
        for caller in silent:
            caller.close()
        wait_until(lambda: get(address + "frame.jpg"))
    assert capfd.readouterr() == ("", "")


def wait_until(action) -> None:
    for _ in range(100):
        with contextlib.suppress(OSError):
            action()
            return
        time.sleep(0.02)
    raise AssertionError("the live view answers nobody")


def test_a_picture_is_worked_out_once_however_many_ask(monkeypatch) -> None:
    eye, coded = Eye(), []
    plain = cv2.imencode
    monkeypatch.setattr(cv2, "imencode", lambda *one: (coded.append(1), plain(*one))[1])
    image = np.random.default_rng(0).integers(0, 255, (3000, 4000), np.uint8)
    eye.frame = Frame(image=image, arrival_s=0.0, time_utc="", number=3)
    with live_view(eye, LiveStatus(), lambda: 0.0) as address:
        for _ in range(4):
            get(address + "frame.jpg")
            get(address + "status.json")
    assert len(coded) == 1
