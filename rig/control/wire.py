"""The socket itself: a Unix socket of the owner's, or loopback TCP with a token.

One line of JSON each way. Where the system has no Unix sockets (Windows), the file that
would be the socket holds the number of a port on 127.0.0.1 and a token, which every
caller must repeat; the folder it stands in belongs to the user.
"""

from __future__ import annotations

import contextlib
import hmac
import json
import os
import secrets
import socket
import time
from pathlib import Path
from typing import Any

from ...core.files import write_text

HAS_UNIX = hasattr(socket, "AF_UNIX")
MAX_LINE = 65_536
TIMEOUT_S = 5.0
_WAITING = 128
_AGAIN_S = 0.02

Message = dict[str, Any]


class Line:
    """A connection that speaks lines of JSON."""

    def __init__(self, connection: socket.socket, timeout_s: float | None) -> None:
        self._socket = connection
        connection.settimeout(timeout_s)
        self._file = connection.makefile("rb")

    def send(self, message: Message) -> None:
        """Send one line.

        Raises
        ------
        OSError
            If the other side is gone.
        """
        self._socket.sendall(json.dumps(message).encode() + b"\n")

    def receive(self) -> Message | None:
        """Return the next line; None if the other side hung up.

        Raises
        ------
        ValueError
            If it is too long or no JSON object.
        OSError
            If it takes longer than the time given.
        """
        line = self._file.readline(MAX_LINE)
        if not line:
            return None
        if not line.endswith(b"\n"):
            raise ValueError("a line is too long, or broke off")
        try:
            return dict(json.loads(line))
        except (ValueError, TypeError, RecursionError):
            raise ValueError("a line is no JSON object") from None

    def close(self) -> None:
        """Hang up."""
        with contextlib.suppress(OSError):
            self._file.close()
        self._socket.close()


class Listener:
    """The owner's end: stands at `path` until it is closed, or its process dies."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._token = ""
        self._is_closed = False
        if HAS_UNIX:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            self._socket.bind(os.fspath(path))
            path.chmod(0o600)
        else:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._socket.bind(("127.0.0.1", 0))
            self._token = secrets.token_hex(16)
            port = self._socket.getsockname()[1]
            write_text(path, json.dumps({"port": port, "token": self._token}))
        self._socket.listen(_WAITING)

    def accept(self) -> Line:
        """Wait for the next caller.

        Raises
        ------
        OSError
            Once the listener is closed.
        """
        connection, _ = self._socket.accept()
        if self._is_closed:
            connection.close()
            raise OSError("the listener is closed")
        return Line(connection, TIMEOUT_S)

    def may_ask(self, message: Message) -> bool:
        """Return whether a caller is the user: by the folder, or by the token."""
        return hmac.compare_digest(str(message.get("token", "")), self._token)

    def close(self) -> None:
        """Stop listening and take the socket away."""
        self._is_closed = True
        with contextlib.suppress(OSError):
            # Closing a socket does not wake who waits in accept; a caller does.
            caller = socket.socket(self._socket.family, socket.SOCK_STREAM)
            with contextlib.closing(caller):
                caller.settimeout(TIMEOUT_S)
                caller.connect(self._socket.getsockname())
        with contextlib.suppress(OSError):
            self.path.unlink()

    def free(self) -> None:
        """Let go of the socket, once nobody waits in `accept`."""
        self._socket.close()


def call(path: Path, message: Message, timeout_s: float | None) -> Line | None:
    """Connect to an owner and send the first line; None if nobody listens any more.

    Raises
    ------
    OSError
        If somebody listens and does not take the line.
    """
    try:
        if not HAS_UNIX:
            known = json.loads(path.read_text(encoding="utf-8"))
            message = {**message, "token": known["token"]}
            address: Any = ("127.0.0.1", int(known["port"]))
        else:
            address = os.fspath(path)
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        return None
    connection = socket.socket(socket.AF_UNIX if HAS_UNIX else socket.AF_INET)
    line = Line(connection, TIMEOUT_S)
    try:
        _connect(connection, address)
        line.send(message)
        connection.settimeout(timeout_s)
    except (ConnectionRefusedError, FileNotFoundError):
        line.close()
        return None
    except BaseException:
        line.close()
        raise
    return line


def _connect(connection: socket.socket, address: Any) -> None:
    """Connect, also past a crowd: a full Unix socket does not wait, it says so."""
    until_s = time.monotonic() + TIMEOUT_S
    while True:
        try:
            return connection.connect(address)
        except BlockingIOError:
            if time.monotonic() > until_s:
                raise
            time.sleep(_AGAIN_S)
