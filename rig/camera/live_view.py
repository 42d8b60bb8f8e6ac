"""A page on loopback that shows what the camera sees and what the run is doing.

It reads the newest picture of the capture thread that the run itself uses, never opens
the camera a second time, takes no commands, and listens on 127.0.0.1 only.
"""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Protocol, runtime_checkable

from ...core.errors import RigError
from .protocol import Frame

_HIGHEST_PORT = 65_535
_MOST_CALLERS = 16
_CALLER_S = 5.0
_MOST_PIXELS = 500_000
_MIDDLE_PX = 700

_PAGE = """<!doctype html><meta charset="utf-8"><title>magbend</title>
<meta name="viewport" content="width=device-width">
<style>body{font:16px system-ui;margin:1em;background:#fff;color:#111}
img{max-width:100%}@media(prefers-color-scheme:dark){body{background:#111;color:#eee}}
</style><p id="s">waiting</p><img id="i" alt="newest picture">
<script>
async function tick(){
 try{const s=await (await fetch("status.json")).json();
  document.getElementById("s").textContent=s.line+" · picture "+(s.age_s===null?
   "none":s.age_s.toFixed(1)+" s old, background "+(100*s.brightness).toFixed(0)+
   " %, saturated "+s.saturated_percent.toFixed(1)+" %, focus "+s.focus.toFixed(1));
  document.getElementById("i").src="frame.jpg?"+Date.now();
 }catch(e){document.getElementById("s").textContent="the run is over";}
 setTimeout(tick,500);}
tick();
</script>"""


@runtime_checkable
class Watched(Protocol):
    """A camera whose newest picture can be looked at."""

    def newest(self) -> Frame | None:
        """Return the newest picture, or None before the first."""
        ...


class LiveStatus:
    """The last line of the run, for the page."""

    def __init__(self) -> None:
        self.line = "starting"

    def report(self, line: str) -> None:
        """Take a line of the run."""
        self.line = line.strip("\a")


@contextlib.contextmanager
def live_view(
    camera: Watched, status: LiveStatus, now_s: Callable[[], float], *, port: int = 0
) -> Iterator[str]:
    """Serve the page while the block runs; yield its address.

    Parameters
    ----------
    camera : Watched
        The camera of the run.
    status : LiveStatus
        What the run says.
    now_s : callable
        The clock of the camera's arrival times.
    port : int
        0 takes any free one.

    Raises
    ------
    RigError
        If the port is taken, or is none.

    Notes
    -----
    Only pages of this address are answered (Host and Origin are checked: a name that
    somebody else owns can be made to point here), at most 16 callers at once; a picture
    is encoded once, however many ask for it.
    """
    if not 0 <= port <= _HIGHEST_PORT:
        raise RigError(
            f"the port of the live view must be from 0 to {_HIGHEST_PORT}; instead "
            f"received {port}"
        )
    looked_at = _Pictures(camera, status, now_s)
    try:
        server = _Server(("127.0.0.1", port), _handler(looked_at.body))
    except OSError as error:
        raise RigError(
            f"the live view cannot listen on port {port}: {error.strerror}; name "
            f"another one"
        ) from None
    thread = threading.Thread(target=server.serve_forever, args=(0.1,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Pictures:
    """What the page shows, worked out once a picture."""

    def __init__(
        self, camera: Watched, status: LiveStatus, now_s: Callable[[], float]
    ) -> None:
        self._camera, self._status, self._now_s = camera, status, now_s
        self._lock = threading.Lock()
        self._facts: tuple[int, dict[str, Any]] | None = None
        self._coded: tuple[int, bytes] | None = None

    def body(self, path: str) -> tuple[str, bytes] | None:
        """Return kind and content of a page; None if there is none."""
        if path == "/":
            return "text/html; charset=utf-8", _PAGE.encode()
        with self._lock:
            frame = self._camera.newest()
            if path == "/status.json":
                return "application/json", json.dumps(self._state(frame)).encode()
            if path == "/frame.jpg" and frame is not None:
                return "image/jpeg", self._jpeg(frame)
        return None

    def _state(self, frame: Frame | None) -> dict[str, Any]:
        if frame is None:
            return {"line": self._status.line, "age_s": None}
        if self._facts is None or self._facts[0] != frame.number:
            self._facts = (frame.number, _facts(frame))
        age_s = self._now_s() - frame.arrival_s
        return {"line": self._status.line, "age_s": age_s, **self._facts[1]}

    def _jpeg(self, frame: Frame) -> bytes:
        import cv2

        if self._coded is None or self._coded[0] != frame.number:
            coded = cv2.imencode(".jpg", frame.image)[1].tobytes()
            self._coded = (frame.number, bytes(coded))
        return self._coded[1]


def _facts(frame: Frame) -> dict[str, Any]:
    """Return what a picture is like; a large one is looked at in parts."""
    import cv2
    import numpy as np

    from .protocol import brightness

    rows, columns = frame.image.shape[:2]
    step = max(1, round((rows * columns / _MOST_PIXELS) ** 0.5))
    image = frame.image[::step, ::step]
    full = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    top, left = (max(0, (size - _MIDDLE_PX) // 2) for size in (rows, columns))
    middle = frame.image[top : top + _MIDDLE_PX, left : left + _MIDDLE_PX]
    grey = (middle if middle.ndim == 2 else middle.mean(axis=2)).astype(np.float32)
    return {
        "number": frame.number,
        "brightness": brightness(image),
        "saturated_percent": 100.0 * float(np.mean(image >= full)),
        "focus": 100.0 * float(cv2.Laplacian(grey / full, cv2.CV_32F).std()),
    }


class _Server(ThreadingHTTPServer):
    """A server that bounds its callers and keeps their troubles off the terminal."""

    daemon_threads = True

    def __init__(self, *arguments: Any) -> None:
        self._callers = threading.BoundedSemaphore(_MOST_CALLERS)
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._callers.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._callers.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a caller that hangs up is no news to the run."""


def _handler(
    body: Callable[[str], tuple[str, bytes] | None],
) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        timeout = _CALLER_S

        def do_GET(self) -> None:
            if not self._is_from_here():
                self.send_error(HTTPStatus.FORBIDDEN)
                return
            found = body(self.path.partition("?")[0])
            if found is None:
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            kind, data = found
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(data)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.send_header("Cross-Origin-Resource-Policy", "same-origin")
            self.end_headers()
            self.wfile.write(data)

        def _is_from_here(self) -> bool:
            port = self.connection.getsockname()[1]
            hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
            origin = self.headers.get("Origin")
            return self.headers.get("Host") in hosts and (
                origin is None or origin.removeprefix("http://") in hosts
            )

        def log_message(self, *_arguments: object) -> None:
            """Say nothing: the terminal belongs to the run."""

    return Handler
