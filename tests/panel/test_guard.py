"""Nobody but our own page may speak to the panel."""

from __future__ import annotations

import base64
import json
import os
import socket
from pathlib import Path

import pytest

from .panel_server import Served, served

JSON = "application/json"


def test_the_page_comes_with_headers_that_keep_others_out(panel: Served) -> None:
    status, body, headers = panel.request("GET", "/")
    assert status == 200
    assert b"<title>magbend panel</title>" in body
    policy = headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert "server" not in headers


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:80", "localhost.evil.example", "", "127.0.0.1:1"],
)
def test_a_foreign_host_is_refused(panel: Served, host: str) -> None:
    status, body, _ = panel.request("GET", "/", Host=host)
    assert status == 403
    assert b"does not answer to the name" in body


@pytest.mark.parametrize(
    "origin",
    ["https://evil.example", "null", "http://127.0.0.1:1", "file://", "http://["],
)
def test_a_foreign_origin_is_refused(panel: Served, origin: str) -> None:
    status, _, _ = panel.request(
        "POST", "/api/stop", {}, Origin=origin, Content_Type=JSON, X_Magbend_Client="a"
    )
    assert status == 403


def test_a_command_by_get_or_from_a_form_is_refused(panel: Served) -> None:
    for name in ("goto", "home", "run-start", "stop"):
        status, body, _ = panel.request("GET", f"/api/{name}")
        assert status == 405
        assert "POST" in json.loads(body)["error"]
    status, _, _ = panel.request("POST", "/api/stop", {}, Content_Type=JSON)
    assert status == 403  # without the header that no foreign page may set
    status, _, _ = panel.request(
        "POST", "/api/stop", {}, Content_Type="text/plain", X_Magbend_Client="a"
    )
    assert status == 400


@pytest.mark.parametrize("body", [[], "stop", 3, None])
def test_a_command_that_is_no_object_is_refused(panel: Served, body: object) -> None:
    status, _, _ = panel.request(
        "POST", "/api/goto", body, Content_Type=JSON, X_Magbend_Client="a"
    )
    assert status in (200, 400)  # None is sent as an empty body: no gap_mm in it


def test_a_socket_from_a_foreign_page_is_refused(panel: Served) -> None:
    for origin in ("https://evil.example", None):
        assert "403" in handshake(panel, origin)
    assert "101" in handshake(panel, f"http://{panel.netloc}")


def handshake(panel: Served, origin: str | None) -> str:
    """Return the first line of the answer to the opening of a socket."""
    host, _, port = panel.netloc.partition(":")
    key = base64.b64encode(os.urandom(16)).decode()
    lines = [
        "GET /socket?client=test HTTP/1.1", f"Host: {panel.netloc}",
        "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Key: {key}", *([f"Origin: {origin}"] if origin else []),
    ]  # fmt: skip
    with socket.create_connection((host, int(port)), timeout=10) as line:
        line.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return line.recv(200).decode("latin-1").partition("\r\n")[0]


def test_a_file_outside_a_run_is_not_shown(panel: Served) -> None:
    for path in ("/runs/../rig.toml", "/runs/%2e%2e/rig.toml", "/runs/.hidden/x.png",
                 "/static/../panel.py", "/runs/none/images/a.png",
                 f"/runs/{'n' * 300}/images/a.png"):  # fmt: skip
        status, _, _ = panel.request("GET", path)
        assert status == 404, path


def test_another_address_than_loopback_needs_its_token(tmp_path: Path) -> None:
    with served(tmp_path / "rig.toml", host="0.0.0.0") as server:
        url = server.url
        assert "token=" in url
        assert "not encrypted" in " ".join(server.said)
        token = url.partition("token=")[2]
        port = server.netloc.rpartition(":")[2]
        local = f"127.0.0.1:{port}"
        assert server.request("GET", "/", Host=local)[0] == 401
        assert server.request("GET", "/?token=wrong", Host=local)[0] == 401
        status, _, headers = server.request("GET", f"/?token={token}", Host=local)
        assert status == 303
        cookie = headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "samesite=strict" in cookie.lower()
        pair = cookie.partition(";")[0]
        assert server.request("GET", "/", Host=local, Cookie=pair)[0] == 200
        assert server.request("GET", "/", Host=f"evil.example:{port}")[0] == 403
