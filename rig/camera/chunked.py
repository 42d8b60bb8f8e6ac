"""Take the chunks of ``Transfer-Encoding: chunked`` apart, however they are cut.

The HTTP client of the standard library cannot: after a read that found nothing yet its
stream is dead, and the newest picture is found by such reads. Cheap camera boards send
chunks even in answer to HTTP/1.0.
"""

from __future__ import annotations

from ...core.errors import CameraError

_LONGEST_HEAD = 4096


class Chunks:
    """Bytes of the wire in, bytes of the body out."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._left = 0
        self.is_over = False

    def feed(self, data: bytes) -> bytes:
        """Return what of the body is here now; `is_over` after the last chunk.

        Raises
        ------
        CameraError
            If the length of a chunk is none: the stream is out of step.
        """
        self._buffer += data
        body = bytearray()
        while not self.is_over:
            taken = self._buffer[: self._left]
            body += taken
            del self._buffer[: len(taken)]
            self._left -= len(taken)
            if self._left or not self._next_chunk():
                break
        return bytes(body)

    def _next_chunk(self) -> bool:
        """Read the head of the next chunk; return whether it is here."""
        while self._buffer[:2] == b"\r\n":  # ends the chunk before
            del self._buffer[:2]
        end = self._buffer.find(b"\r\n")
        if end < 0:
            if len(self._buffer) > _LONGEST_HEAD:
                raise CameraError("a chunk of the stream has no length")
            return False
        head = bytes(self._buffer[:end]).partition(b";")[0].strip()
        del self._buffer[: end + 2]
        try:
            self._left = int(head, 16)
        except ValueError:
            raise CameraError(
                f"a chunk of the stream must begin with its length; instead received "
                f"{head[:20]!r}"
            ) from None
        self.is_over = self._left == 0
        return True
