"""The address space of the panel: the page, its socket, commands and pictures."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from ..core.errors import InputError, MagbendError
from .commands import COMMANDS, Caller, carry_out
from .controls import NotYoursError
from .guard import CLIENT_HEADER, Guard
from .hub import dump
from .panel import Panel
from .queries import QUERIES, File, run_file

STATIC = Path(__file__).parent / "static"
_MOST_BYTES = 1_000_000
_REPORT_POLICY = (
    "sandbox allow-scripts allow-popups allow-downloads; default-src 'none'; "
    "style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
)
"""A report brings its own script: it runs in a sandbox that cannot reach the panel."""


def make_app(
    panel: Panel, is_ours: Callable[[str], bool], *, token: str = ""
) -> Starlette:
    """Return the application that serves a panel.

    Parameters
    ----------
    panel : Panel
        What is served.
    is_ours : callable
        Whether a value of Host names this panel.
    token : str
        Asked for if not empty.
    """

    @contextlib.asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        panel.hub.attach(asyncio.get_running_loop())
        yield
        panel.hub.detach()

    routes = [
        Route("/", _page),
        Route("/api/{name}", partial(_query, panel), methods=["GET"]),
        Route("/api/{name}", partial(_command, panel), methods=["POST"]),
        Route("/runs/{run}/{path:path}", partial(_run_file, panel)),
        WebSocketRoute("/socket", partial(_socket, panel)),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    guard = Middleware(Guard, is_ours=is_ours, token=token)
    return Starlette(routes=routes, middleware=[guard], lifespan=lifespan)


async def _page(_request: Request) -> Response:
    return FileResponse(STATIC / "index.html", media_type="text/html")


async def _socket(panel: Panel, socket: WebSocket) -> None:
    client = socket.query_params.get("client", "")[:64]
    if not client:
        await socket.close(code=1008)
        return
    await panel.hub.serve(socket, client, _who(socket.headers, socket.client))


async def _command(panel: Panel, request: Request) -> Response:
    name = request.path_params["name"]
    if name not in COMMANDS:
        return _refused(404, f"there is no command {name!r}")
    try:
        arguments = await _arguments(request)
    except InputError as error:
        return _refused(400, str(error))
    caller = Caller(
        client=request.headers[CLIENT_HEADER][:64],
        name=_who(request.headers, request.client),
    )
    return await _answer(partial(carry_out, panel, caller, name, arguments))


async def _query(panel: Panel, request: Request) -> Response:
    name = request.path_params["name"]
    if name in COMMANDS:
        return _refused(405, f"{name} is a command: it is sent by POST alone")
    if name not in QUERIES:
        return _refused(404, f"there is nothing named {name!r}")
    return await _answer(partial(QUERIES[name], panel, dict(request.query_params)))


async def _run_file(panel: Panel, request: Request) -> Response:
    run, path = request.path_params["run"], request.path_params["path"]
    try:
        found = await run_in_threadpool(
            run_file, panel, run, path, request.query_params.get("width", "")
        )
    except MagbendError as error:
        return _refused(404, str(error))
    if isinstance(found, File):
        return Response(found.data, media_type=found.kind)
    headers = {}
    if found.suffix == ".html":
        headers["Content-Security-Policy"] = _REPORT_POLICY
    return FileResponse(found, headers=headers)


async def _arguments(request: Request) -> dict[str, Any]:
    if request.headers.get("content-type", "").partition(";")[0] != "application/json":
        raise InputError("a command is sent as application/json")
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > _MOST_BYTES:
            raise InputError("a command is not that long")
    try:
        data = json.loads(body or b"{}")
    except (ValueError, RecursionError):
        data = None
    if not isinstance(data, dict):
        raise InputError("a command must be one JSON object")
    return data


async def _answer(work: Callable[[], Any]) -> Response:
    try:
        found = await run_in_threadpool(work)
    except NotYoursError as error:
        return _refused(200, str(error), why="not yours")
    except MagbendError as error:
        return _refused(200, str(error), why="refused")
    if isinstance(found, File):
        return Response(found.data, media_type=found.kind)
    return Response(dump(found), media_type="application/json")


def _refused(status: int, sentence: str, *, why: str = "wrong") -> Response:
    """Return a refusal; what the bench refuses is an answer, not a failed request."""
    body = {"ok": False, "why": why, "error": " ".join(sentence.split())}
    return JSONResponse(body, status_code=status)


def _who(headers: Any, address: Any) -> str:
    """Return how others see a page: its browser and the machine it is on."""
    agent = headers.get("user-agent", "")
    known = ("Firefox", "Edg", "Chrome", "Safari")
    browser = next((name for name in known if name in agent), "a program")
    systems = ("Android", "iPhone", "iPad", "Windows", "Mac", "Linux")
    system = next((f" on {name}" for name in systems if name in agent), "")
    browser = {"Edg": "Edge"}.get(browser, browser)
    return f"{browser}{system}, {address.host if address else 'unknown'}"
