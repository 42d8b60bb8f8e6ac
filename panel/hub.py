"""The pages that are open: each is sent the newest state and picture it can take.

Nothing is queued. A page is sent the next picture when it has shown the last one, so a
slow telephone sees fewer pictures, never old ones, and fifty pages cost memory of one.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import time
from collections.abc import Callable
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from .bench.sight import Packed
from .controls import Controls

logger = logging.getLogger(__name__)

MOST_PAGES = 64
STATE_S = 0.1
HEARTBEAT_S = 1.0
SMOOTH_S = 0.04
RESTING_S = 1.0
AWAKE_S = 120.0
"""Without a key, a finger or a motion for so long, pictures come once a second."""


class Page:
    """One open page.

    Parameters
    ----------
    socket : WebSocket
        Its connection.
    client : str
        Its secret.
    name : str
        What others see of it.
    """

    def __init__(self, socket: WebSocket, client: str, name: str) -> None:
        self.socket = socket
        self.client = client
        self.name = name
        self.wants_picture = False
        self.is_ready = True
        self.sent: dict[str, object] = {}
        self.wake = asyncio.Event()


class Hub:
    """All open pages.

    Parameters
    ----------
    compose : callable
        Returns the state that all pages share.
    controls : Controls
        Who may command.
    """

    def __init__(
        self, compose: Callable[[], dict[str, Any]], controls: Controls
    ) -> None:
        self._compose = compose
        self._controls = controls
        self._loop: asyncio.AbstractEventLoop | None = None
        self._pages: set[Page] = set()
        self._state = "{}"
        self._overlay = ""
        self._packed: Packed | None = None
        self._is_dirty = False
        self._awake_s = -math.inf

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Take the event loop in which pages are served."""
        self._loop = loop
        self._beat()

    def detach(self) -> None:
        """Forget the event loop: it is about to end."""
        self._loop = None

    @property
    def pages(self) -> list[Page]:
        """The open pages."""
        return list(self._pages)

    @property
    def is_watched(self) -> bool:
        """Whether any page is open."""
        return bool(self._pages)

    def pace_s(self, *, is_moving: bool) -> float:
        """Return the least time between two pictures, infinite while nobody looks."""
        if not any(page.wants_picture for page in self.pages):
            return math.inf
        is_awake = time.monotonic() - self._awake_s < AWAKE_S
        return SMOOTH_S if is_awake or is_moving else RESTING_S

    def changed(self) -> None:
        """Say that the state may have changed; safe from any thread."""
        self._call(self._mark)

    def show(self, packed: Packed) -> None:
        """Take the newest picture; safe from any thread."""
        self._packed = packed
        self._call(self._wake_all)

    def draw(self, overlay: dict[str, Any]) -> None:
        """Take the newest overlay; safe from any thread."""
        self._overlay = dump({"type": "overlay", **overlay})
        self._call(self._wake_all)

    def _call(self, function: Callable[[], None]) -> None:
        loop = self._loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # it ends just now
                loop.call_soon_threadsafe(function)

    def _mark(self) -> None:
        if not self._is_dirty and self._pages and self._loop is not None:
            self._is_dirty = True
            self._loop.call_later(STATE_S, self._push)

    def _push(self) -> None:
        self._is_dirty = False
        if self._pages:
            self._state = dump(self._compose())
            self._wake_all()

    def _beat(self) -> None:
        if self._loop is not None:
            self._mark()
            self._loop.call_later(HEARTBEAT_S, self._beat)

    def _wake_all(self) -> None:
        for page in self._pages:
            page.wake.set()

    async def serve(self, socket: WebSocket, client: str, name: str) -> None:
        """Serve one page until it goes."""
        await socket.accept()
        if len(self._pages) >= MOST_PAGES:
            reason = f"{MOST_PAGES} pages are open already; close one"
            await socket.close(code=1013, reason=reason)
            return
        page = Page(socket, client, name)
        self._pages.add(page)
        self._controls.back(client)
        self._awake_s = time.monotonic()
        self._push()
        sender = asyncio.create_task(self._send(page))
        try:
            while True:
                self._hear(page, await socket.receive_text())
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._pages.discard(page)
            if not any(other.client == client for other in self._pages):
                self._controls.away(client)
            sender.cancel()
            self._mark()

    def _hear(self, page: Page, text: str) -> None:
        """Take what a page says of itself; commands never come this way."""
        try:
            said = json.loads(text)
        except ValueError:
            return
        if not isinstance(said, dict):
            return
        if "picture" in said:
            page.wants_picture = said["picture"] is True
            page.is_ready = True
        if "shown" in said:
            page.is_ready = True
        if said.get("awake"):
            self._awake_s = time.monotonic()
        page.wake.set()

    async def _send(self, page: Page) -> None:
        try:
            while True:
                await page.wake.wait()
                page.wake.clear()
                await self._send_news(page)
        except (WebSocketDisconnect, RuntimeError, OSError):
            pass  # it is gone
        except Exception:
            logger.exception("a page could not be told the news")

    async def _send_news(self, page: Page) -> None:
        state = self._state_for(page)
        if page.sent.get("state") != state:
            page.sent["state"] = state
            await page.socket.send_text(state)
        packed = self._packed
        if (
            packed is not None
            and page.wants_picture
            and page.is_ready
            and page.sent.get("picture") is not packed
        ):
            page.sent["picture"], page.is_ready = packed, False
            await page.socket.send_bytes(_frame(packed))
        overlay = self._overlay
        if page.wants_picture and page.sent.get("overlay") is not overlay and overlay:
            page.sent["overlay"] = overlay
            await page.socket.send_text(overlay)

    def _state_for(self, page: Page) -> str:
        holder = self._controls.holder
        you = {
            "has_controls": holder is not None and holder.client == page.client,
            "holder": holder.name if holder else None,
            "since_utc": holder.since_utc if holder else None,
        }
        return f'{{"type":"state","you":{json.dumps(you)},"state":{self._state}}}'


def dump(data: Any) -> str:
    """Return `data` as JSON; NaN and infinity become null, since JSON has neither."""
    return json.dumps(_plain(data), allow_nan=False, ensure_ascii=False)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _frame(packed: Packed) -> bytes:
    """Return a picture as one message: length of the header, header, JPEG."""
    header = json.dumps(
        {
            "number": packed.number,
            "size_px": packed.size_px,
            "age_s": time.monotonic() - packed.arrival_s,
        }
    ).encode()
    return len(header).to_bytes(4, "big") + header + packed.jpeg
