"""Bytes of a table that someone saved, to text: encodings, and what is no text at all.

Spreadsheets and instruments save UTF-8 with and without a byte order mark, UTF-16,
Windows-1252 and Mac Roman; only the letters outside ASCII tell the last two apart.
"""

from __future__ import annotations

from pathlib import Path

from .door import read_file
from .errors import ConfigError

_MARKS = (
    (b"\xef\xbb\xbf", "utf-8-sig"),
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)

_KINDS = (
    (b"PK\x03\x04", "an Excel or OpenDocument workbook or an archive"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook"),
    (b"\x89HDF", "an HDF5 or MATLAB 7.3 file"),
    (b"MATLAB 5.0", "a MATLAB file"),
    (b"PAR1", "a Parquet file"),
    (b"%PDF", "a PDF"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"\x1f\x8b", "a compressed file"),
)
"""First bytes of what people name by mistake."""


def read_bytes(path: Path, limit_MB: float = 64.0) -> bytes:
    """Return the bytes of a file the user named, never more than the limit.

    Raises
    ------
    ConfigError
        If it is missing, a folder, unreadable, or longer than `limit_MB`.
    """
    return read_file(path, limit_MB)


def decode_text(data: bytes, path: Path) -> str:
    """Return the text of a file in whatever encoding it was saved.

    Raises
    ------
    ConfigError
        If it is no text; what it seems to be is named where its first bytes tell.
    """
    for start, kind in _KINDS:
        if data.startswith(start):
            raise ConfigError(f"{path}: is {kind}, not a table; save it as CSV text")
    try:
        text = data.decode(_encoding(data))
    except UnicodeDecodeError as error:
        raise ConfigError(
            f"{path}: is no text (byte {error.start} cannot be read as "
            f"{error.encoding}); save it as CSV in UTF-8"
        ) from None
    if "\x00" in text:
        raise ConfigError(f"{path}: is no text table, it holds zero bytes")
    return text


def _encoding(data: bytes) -> str:
    for mark, name in _MARKS:
        if data.startswith(mark):
            return name
    head = data[:4096]
    if len(head) >= 4 and head.count(0) > len(head) // 3:  # UTF-16 without its mark
        return "utf-16-le" if head[1::2].count(0) > head[::2].count(0) else "utf-16-be"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return _single_byte(data)
    return "utf-8"


def _single_byte(data: bytes) -> str:
    """Tell Mac Roman from Windows: a Mac has its letters where Windows has signs."""
    mac = sum(1 for byte in data if 0x80 <= byte < 0xA0 or byte == 0xA1)
    windows = sum(1 for byte in data if byte >= 0xC0 or byte == 0xB0)
    bare_returns = data.count(b"\r") > data.count(b"\r\n")
    if mac > windows or (bare_returns and mac == windows):
        return "mac-roman"
    return "cp1252" if not set(data) & {0x81, 0x8D, 0x8F, 0x90, 0x9D} else "latin-1"
