"""A panel on a free port of loopback, served from a thread of the test."""

from __future__ import annotations

import contextlib
import http.client
import json
import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from magbend.panel import Address, Panel, Twin, Workspace, hub, serve

SPEED = 6.0
hub.SMOOTH_S = 0.25  # four pictures a second are enough for a test, and cheap


@dataclass(frozen=True)
class Served:
    """A panel that is being served, and how a program speaks to it."""

    panel: Panel
    url: str
    said: list[str]

    @property
    def netloc(self) -> str:
        return urlsplit(self.url).netloc

    def request(
        self, method: str, path: str, body: Any = None, **headers: str
    ) -> tuple[int, bytes, dict[str, str]]:
        """Send one request; header names are written with underscores."""
        connection = http.client.HTTPConnection(self.netloc, timeout=20)
        sent = {"Host": self.netloc}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        data = None if body is None else json.dumps(body).encode()
        with contextlib.closing(connection):
            connection.putrequest(method, path, skip_host=True)
            for name, value in sent.items():
                connection.putheader(name, value)
            if data is not None:
                connection.putheader("Content-Length", str(len(data)))
            connection.endheaders(data)
            answer = connection.getresponse()
            return answer.status, answer.read(), dict(answer.getheaders())

    def command(
        self, name: str, /, client: str = "test", **values: Any
    ) -> dict[str, Any]:
        """Send a command as a page does."""
        status, body, _ = self.request(
            "POST", f"/api/{name}", values,
            Content_Type="application/json", X_Magbend_Client=client,
        )  # fmt: skip
        assert status == 200, body
        return dict(json.loads(body))

    def query(self, path: str) -> Any:
        """Look something up as a page does."""
        _, body, _ = self.request("GET", f"/api/{path}")
        return json.loads(body)


@contextlib.contextmanager
def served(rig: Path, *, host: str = "127.0.0.1") -> Iterator[Served]:
    """Serve the panel of a rig file while the block runs."""
    panel = Panel(Workspace(rig), twin=Twin(seed=2, speed=SPEED))
    told: queue.Queue[str] = queue.Queue()
    said: list[str] = []

    def tell(line: str) -> None:
        said.append(line)
        told.put(line)

    stop = threading.Event()
    thread = threading.Thread(
        target=serve, args=(panel, Address(host=host, port=0)),
        kwargs={"browser": False, "tell": tell, "stop": stop}, daemon=True,
    )  # fmt: skip
    thread.start()
    try:
        url = told.get(timeout=20)
        yield Served(panel=panel, url=url, said=said)
    finally:
        stop.set()
        thread.join(timeout=60)  # its own threads may take 40 s together
    assert not thread.is_alive()
