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
        If the port is taken.
    """

    def body(path: str) -> tuple[str, bytes] | None:
        if path == "/":
            return "text/html; charset=utf-8", _PAGE.encode()
        frame = camera.newest()
        if path == "/status.json":
            return "application/json", json.dumps(_state(frame, status, now_s)).encode()
        if path == "/frame.jpg" and frame is not None:
            return "image/jpeg", _jpeg(frame)
        return None

    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), _handler(body))
    except OSError as error:
        raise RigError(
            f"the live view cannot listen on port {port}: {error.strerror}; name "
            f"another one"
        ) from None
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.1,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def _state(
    frame: Frame | None, status: LiveStatus, now_s: Callable[[], float]
) -> dict[str, Any]:
    import cv2
    import numpy as np

    from .protocol import brightness

    if frame is None:
        return {"line": status.line, "age_s": None}
    image = frame.image
    full = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    grey = image if image.ndim == 2 else image.mean(axis=2)
    return {
        "line": status.line,
        "number": frame.number,
        "age_s": now_s() - frame.arrival_s,
        "brightness": brightness(image),
        "saturated_percent": 100.0 * float(np.mean(image >= full)),
        "focus": float(cv2.Laplacian(grey.astype(np.float32) / full, cv2.CV_32F).std())
        * 100.0,
    }


def _jpeg(frame: Frame) -> bytes:
    import cv2

    return bytes(cv2.imencode(".jpg", frame.image)[1].tobytes())


def _handler(
    body: Callable[[str], tuple[str, bytes] | None],
) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            found = body(self.path.partition("?")[0])
            if found is None:
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            kind, data = found
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(data)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            with contextlib.suppress(OSError):
                self.wfile.write(data)

        def log_message(self, *_arguments: object) -> None:
            """Say nothing: the terminal belongs to the run."""

    return Handler
