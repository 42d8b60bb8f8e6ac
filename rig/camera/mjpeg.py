"""Motion JPEG over HTTP, read by ourselves, byte for byte.

OpenCV reads such streams too, but it hands out pictures in the order of its queue,
takes a truncated JPEG for a good one, and stays dead after a stall. Here every part is
checked to be a whole JPEG, a backlog is skipped without decoding it, and the time at
which a picture began to arrive is known.
"""

from __future__ import annotations

import base64
import contextlib
import re
import socket
import ssl
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np

from ...core.errors import CameraError
from ...core.jpeg import is_damaged
from ...core.picture import decode_picture
from ...core.urls import without_secrets
from ..clock import Clock
from .capture import BrokenPictureError
from .chunked import Chunks
from .protocol import Image

_CHUNK = 1 << 16
_LARGEST = 1 << 26
_DRAIN_S = 0.5
_START, _END = b"\xff\xd8", b"\xff\xd9"
_PADDING = b"\r\n\0 "


class MjpegSource:
    """A ``multipart/x-mixed-replace`` stream of JPEG pictures.

    Parameters
    ----------
    url : str
        ``http://`` or ``https://``, with user and password if needed.
    clock : Clock
        Time.
    timeout_s : float
        How long a silent stream is waited for.
    """

    def __init__(self, url: str, clock: Clock, *, timeout_s: float) -> None:
        self._url = url
        self._name = without_secrets(url)
        self._clock = clock
        self._timeout_s = timeout_s
        self._socket: socket.socket | None = None
        self._parser = MultipartParser(b"")
        self._chunks: Chunks | None = None
        self._empty_s = 0.0
        self.content_type = ""

    @property
    def identity(self) -> dict[str, Any]:
        """Return the backend and the content type."""
        return {"backend": "mjpeg", "content_type": self.content_type}

    def open(self) -> None:
        """Connect and read the response header.

        Raises
        ------
        CameraError
            If nobody answers, or the answer is no motion JPEG.
        """
        try:
            self._socket = _connect(self._url, self._timeout_s)
            self._socket.sendall(_request(self._url))
            header, rest = self._response_header(self._socket)
        except OSError as error:
            raise CameraError(f"{self._name}: {error}") from None
        status = header.split(b"\r\n", 1)[0].split()
        if len(status) < 2 or status[1] != b"200":
            line = header.split(b"\r\n", 1)[0].decode("latin-1")
            raise CameraError(f"{self._name}: the server answered {line!r}")
        found = re.search(rb"(?im)^content-type:\s*([^\r\n]+)", header)
        self.content_type = found.group(1).decode("latin-1").strip() if found else ""
        boundary = re.search(r'boundary="?([^";\s]+)', self.content_type)
        if "multipart" not in self.content_type or boundary is None:
            raise CameraError(
                f"{self._name}: must be a motion JPEG stream (multipart); "
                f"instead its content type is {self.content_type or 'missing'!r}"
            )
        # Some servers write the dashes into the parameter, some do not.
        mark = b"--" + boundary.group(1).lstrip("-").encode("latin-1")
        self._empty_s = self._clock.monotonic_s()
        is_chunked = re.search(rb"(?im)^transfer-encoding:.*\bchunked", header)
        self._chunks = Chunks() if is_chunked else None
        self._parser = MultipartParser(mark)
        self._parser.feed(self._body(rest), self._empty_s)

    def read(self) -> tuple[Image, float]:
        """Return the newest whole picture; older ones in the queue are skipped.

        Raises
        ------
        BrokenPictureError
            If that part is no whole JPEG.
        CameraError
            If the stream stalled or was closed.
        """
        newest: Part | None = None
        start_s = self._clock.monotonic_s()
        while True:
            while (part := self._parser.next_part()) is not None:
                newest = part
            # A server without any pace never lets the queue run empty.
            is_late = self._clock.monotonic_s() - start_s > _DRAIN_S
            if newest is not None and is_late:
                break
            chunk = self._receive(0.0 if newest is not None else self._timeout_s)
            if chunk is None:
                break
            self._parser.feed(self._body(chunk), self._empty_s)
        if newest is None:
            raise CameraError(f"{self._name}: sent nothing")
        return decode_jpeg(newest[0]), newest[1]

    def _body(self, data: bytes) -> bytes:
        """Return what of the body came with these bytes."""
        if self._chunks is None:
            return data
        body = self._chunks.feed(data)
        if self._chunks.is_over and not body:
            raise CameraError(f"{self._name}: the server ended the stream")
        return body

    def close(self) -> None:
        """Close the connection."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
            self._socket = None

    def _receive(self, timeout_s: float) -> bytes | None:
        """Return what is there; None if nothing is and `timeout_s` is zero."""
        if self._socket is None:
            raise CameraError(f"{self._name}: is not open")
        try:
            chunk = self._recv(0.0)
            if chunk is None and timeout_s > 0.0:
                chunk = self._recv(timeout_s)
                # Until these bytes came the queue was empty: they are new.
                self._empty_s = self._clock.monotonic_s()
            elif chunk is None:
                return None
        except OSError as error:
            raise CameraError(f"{self._name}: {error}") from None
        if chunk is None:
            raise CameraError(f"{self._name}: the stream stalled for {timeout_s:g} s")
        if not chunk:
            raise CameraError(f"{self._name}: the server closed the stream")
        return chunk

    def _recv(self, timeout_s: float) -> bytes | None:
        if self._socket is None:
            return b""
        self._socket.settimeout(timeout_s)
        try:
            return self._socket.recv(_CHUNK)
        except (TimeoutError, BlockingIOError, ssl.SSLWantReadError):
            return None

    def _response_header(self, connection: socket.socket) -> tuple[bytes, bytes]:
        data = b""
        while b"\r\n\r\n" not in data:
            chunk = connection.recv(_CHUNK)
            if not chunk or len(data) > _CHUNK:
                raise CameraError(f"{self._name}: does not speak HTTP")
            data += chunk
        header, _, rest = data.partition(b"\r\n\r\n")
        return header, rest


Part = tuple[bytes, float]
"""Body of one part, and when its transfer began."""


class MultipartParser:
    """Cut a multipart stream into parts, also when a part was cut short.

    Parameters
    ----------
    mark : bytes
        The boundary with its two dashes.
    """

    def __init__(self, mark: bytes) -> None:
        self._mark = mark
        self._buffer = bytearray()
        self._time_s = self._began_s = 0.0
        self._length: int | None = None
        self._in_body = False

    def feed(self, data: bytes, time_s: float) -> None:
        """Take bytes; `time_s` is the last moment at which the queue was empty."""
        self._time_s = time_s
        if not self._in_body or not self._buffer:
            self._began_s = time_s
        self._buffer += data

    def next_part(self) -> Part | None:
        """Return the next part, or None if it has not arrived whole.

        Raises
        ------
        CameraError
            If a part grows beyond all reason: the stream is out of step.
        """
        if len(self._buffer) > _LARGEST:
            raise CameraError("a part of the stream is larger than 64 MB")
        if not self._in_body and not self._skip_header():
            return None
        size = self._body_size()
        if size is None:
            return None
        part = (bytes(self._buffer[:size]), self._began_s)
        del self._buffer[:size]
        self._in_body = False
        self._began_s = self._time_s
        return part

    def _body_size(self) -> int | None:
        """Return where the body ends in the buffer, or None if not yet."""
        length = self._length
        is_there = length is not None and len(self._buffer) >= length
        if is_there and self._buffer[:length].rstrip(_PADDING).endswith(_END):
            return length
        # Whatever the length said, a part ends at the next boundary.
        following = self._buffer.find(self._mark)
        if following >= 0:
            return following
        if is_there:
            return length
        # Without a length: it ends when all that began (thumbnails inside) has ended.
        is_whole = (
            length is None
            and self._buffer.rstrip(_PADDING).endswith(_END)
            and self._buffer.count(_START) == self._buffer.count(_END)
        )
        return len(self._buffer) if is_whole else None

    def _skip_header(self) -> bool:
        at = self._buffer.find(self._mark)
        if at < 0:
            # Between parts only line breaks may stand; keep what may be half a mark.
            del self._buffer[: max(len(self._buffer) - len(self._mark), 0)]
            return False
        end = self._buffer.find(b"\r\n\r\n", at)
        if end < 0:
            return False
        header = bytes(self._buffer[at:end])
        length = re.search(rb"(?im)^content-length:\s*(\d+)", header)
        self._length = int(length.group(1)) if length else None
        del self._buffer[: end + 4]
        self._in_body = True
        return True


def prepare() -> None:
    """Load what checks pictures; the first time ever that takes seconds.

    A camera must not be waited for meanwhile.
    """
    import cv2

    is_damaged(cv2.imencode(".jpg", np.zeros((16, 16, 3), np.uint8))[1].tobytes())


def decode_jpeg(data: bytes) -> Image:
    """Return the picture of a whole JPEG, grey or blue-green-red as it was stored.

    Raises
    ------
    BrokenPictureError
        If its start or end mark is missing, its coded data go astray, or it is too
        large.
    """
    body = data.strip(_PADDING)
    if not body.startswith(_START):
        raise BrokenPictureError("it does not begin as a JPEG")
    if not body.endswith(_END):
        raise BrokenPictureError(f"it was cut off after {len(body)} bytes")
    return np.asarray(decode_picture(body, "it", BrokenPictureError))


def _connect(url: str, timeout_s: float) -> socket.socket:
    parts = urlsplit(url)
    port = parts.port or (443 if parts.scheme == "https" else 80)
    host = parts.hostname or ""
    connection = socket.create_connection((host, port), timeout=timeout_s)
    if parts.scheme != "https":
        return connection
    return ssl.create_default_context().wrap_socket(connection, server_hostname=host)


def _request(url: str) -> bytes:
    parts = urlsplit(url)
    path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
    lines = [f"GET {path} HTTP/1.0", f"Host: {parts.hostname}", "Accept: */*"]
    if parts.username is not None:
        user = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
        token = base64.b64encode(user.encode("utf-8")).decode("ascii")
        lines.append(f"Authorization: Basic {token}")
    return ("\r\n".join(lines) + "\r\n\r\n").encode("latin-1")
