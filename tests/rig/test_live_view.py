from __future__ import annotations

import json
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
