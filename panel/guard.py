"""Who may speak to the panel: the right host, the right page, the right token.

A page elsewhere in the same browser can send requests to loopback, and a name that
somebody else owns can be made to point here (DNS rebinding). So the Host must be one of
ours, an Origin must be the page that we served, commands come by POST with a header
that no foreign page may set, and an address beyond loopback asks for a token.
"""

from __future__ import annotations

import hmac
from collections.abc import Callable
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

CLIENT_HEADER = "x-magbend-client"
COOKIE = "magbend-panel"

POLICY = (
    "default-src 'self'; img-src 'self' blob: data:; object-src 'none'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What our own pages may load: nothing from anywhere else."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Guard:
    """Refuse what did not come from our own page; put safe headers on every answer.

    Parameters
    ----------
    app : ASGI application
        What is guarded.
    is_ours : callable
        Whether a value of Host, such as ``127.0.0.1:8765``, names this panel.
    token : str
        Asked for if not empty.
    """

    def __init__(
        self, app: ASGIApp, *, is_ours: Callable[[str], bool], token: str = ""
    ) -> None:
        self._app = app
        self._is_ours = is_ours
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it with a sentence."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refusal = self._refusal(scope, headers)
        if refusal:
            await _refuse(scope, receive, send, 403, refusal)
            return
        if self._token and not self._has_token(headers):
            await self._ask_token(scope, receive, send)
            return
        await self._app(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope, headers: Headers) -> str:
        host = headers.get("host", "").lower()
        if not self._is_ours(host):
            return f"this panel does not answer to the name {host!r}"
        origin = headers.get("origin")
        if origin is not None and origin.lower() not in (
            f"http://{host}", f"https://{host}"
        ):  # fmt: skip
            return f"this panel takes nothing from the page {origin!r}"
        if scope["type"] == "websocket":
            return "" if origin is not None else "a socket needs an Origin"
        if scope["method"] not in ("GET", "HEAD") and not headers.get(CLIENT_HEADER):
            return f"a command needs the header {CLIENT_HEADER}"
        return ""

    def _has_token(self, headers: Headers) -> bool:
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return False
        return cookie is not None and self._is_token(cookie.value)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())

    async def _ask_token(self, scope: Scope, receive: Receive, send: Send) -> None:
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        given = query.get("token", [""])[0]
        is_page = scope["type"] == "http" and scope["method"] == "GET"
        if is_page and self._is_token(given):
            # The token leaves the address bar at once and stays in a cookie.
            answer = RedirectResponse("/", status_code=303)
            answer.set_cookie(
                COOKIE, self._token, httponly=True, samesite="strict", path="/"
            )
            await answer(scope, receive, _with_headers(send))
            return
        await _refuse(
            scope, receive, send, 401,
            "this panel needs its token: open the address that magbend panel printed",
        )  # fmt: skip


async def _refuse(
    scope: Scope, receive: Receive, send: Send, status: int, sentence: str
) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": sentence[:100]})
        return
    answer = PlainTextResponse(f"magbend: {sentence}\n", status_code=status)
    await answer(scope, receive, _with_headers(send))


def _with_headers(send: Send) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return sent
