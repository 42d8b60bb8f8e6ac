"""Whether the coded pixels of a JPEG file are whole, which decoders do not tell.

A decoder fills what it cannot read and goes on: a byte that was lost or changed on the
way shifts all that follows, and the rod with it, in a picture that looks sound. Here
the Huffman codes of a sequential file (ITU-T T.81, annex F) are walked, their values
left unread: after a fault the blocks hardly ever end where the data ends.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .jit import njit

Bytes = NDArray[np.uint8]
Words = NDArray[np.uint16]
Numbers = NDArray[np.int64]

_SHORT = 11
"""Codes up to so many bits are looked up in a table that stays in the fast cache."""


@dataclass(slots=True)
class _Header:
    """What the segments before the coded data say."""

    tables: dict[int, Words] = field(default_factory=dict)
    size: tuple[int, int] = (0, 0)
    sampling: dict[int, tuple[int, int]] = field(default_factory=dict)
    interval: int = 0


def is_damaged(data: bytes) -> bool:
    """Return whether the coded pixels of a JPEG file break off or go astray.

    Files that are not sequential with all colours in one scan, or whose headers cannot
    be followed, are left to the decoder.
    """
    try:
        return _is_damaged(data)
    except (IndexError, KeyError, ValueError):
        return False


def _is_damaged(data: bytes) -> bool:
    header, place = _Header(), 2
    while data[place] == 0xFF:
        kind = data[place + 1]
        length = int.from_bytes(data[place + 2 : place + 4], "big")
        body = data[place + 4 : place + 2 + length]
        if kind == 0xC4:
            _read_tables(header, body)
        elif kind in (0xC0, 0xC1):
            _read_frame(header, body)
        elif kind == 0xDD:
            header.interval = int.from_bytes(body[:2], "big")
        elif kind == 0xDA:
            return _scan_is_damaged(header, body, data, place + 2 + length)
        place += 1 if kind == 0xFF else 2 + length
    return False


def _read_tables(header: _Header, body: bytes) -> None:
    """Spread each Huffman code over all 16-bit words that begin with it.

    A word then tells the length of its first code (times 256) and its symbol; 0 is no
    code. Tables are kept under their class (16 for AC) plus their number.
    """
    place = 0
    while place < len(body):
        counts = np.frombuffer(body, np.uint8, 16, place + 1).astype(np.int64)
        symbols = np.frombuffer(body, np.uint8, int(counts.sum()), place + 17)
        lengths = np.repeat(np.arange(1, 17), counts)
        words = np.repeat(256 * lengths + symbols, 1 << (16 - lengths))
        table = np.zeros(1 << 16, np.uint16)
        table[: len(words)] = words
        header.tables[body[place]] = table
        place += 17 + len(symbols)


def _read_frame(header: _Header, body: bytes) -> None:
    header.size = int.from_bytes(body[3:5], "big"), int.from_bytes(body[1:3], "big")
    for first in range(6, 6 + 3 * body[5], 3):
        header.sampling[body[first]] = body[first + 1] >> 4, body[first + 1] & 15


def _scan_is_damaged(header: _Header, body: bytes, data: bytes, place: int) -> bool:
    """Walk the one scan of a sequential file; `body` says which tables it uses."""
    parts = [(body[i], body[i + 1]) for i in range(1, 1 + 2 * body[0], 2)]
    if len(parts) != len(header.sampling):
        return False
    tables: list[Words] = []
    used: list[int] = []
    for component, numbers in parts:
        across, down = header.sampling[component] if len(parts) > 1 else (1, 1)
        used += [len(tables)] * (across * down)
        tables += [header.tables[numbers >> 4], header.tables[16 + (numbers & 15)]]
    widest, highest = np.max(list(header.sampling.values()), axis=0)
    unit = (8 * widest, 8 * highest) if len(parts) > 1 else (8, 8)
    units = -(-header.size[0] // unit[0]) * -(-header.size[1] // unit[1])
    coded = np.frombuffer(data, np.uint8, offset=place)
    full = np.array(tables)
    short = np.ascontiguousarray(full[:, :: 1 << (16 - _SHORT)])
    return not _walk(coded, full, short, np.array(used), int(units), header.interval)


@njit(cache=True)
def _walk(
    coded: Bytes, full: Words, short: Words, used: Numbers, units: int, interval: int
) -> bool:
    """Return whether `units` groups of blocks end where the coded data ends."""
    place, word, held, spare, restarts = 0, np.uint64(0), 0, 0, 0
    for unit in range(units):
        if interval and unit and unit % interval == 0:
            place = _marker(coded, place, word, held, spare)
            if place < 0 or coded[place + 1] != 0xD0 + restarts % 8:
                return False
            place, word, held, spare = place + 2, np.uint64(0), 0, 0
            restarts += 1
        for first in used:
            place, word, held, spare = _block(
                coded, full, short, first, place, word, held, spare
            )
            if held < spare:
                return False
    return bool(_marker(coded, place, word, held, spare) >= 0)


@njit(cache=True)
def _marker(coded: Bytes, place: int, word: np.uint64, held: int, spare: int) -> int:
    """Return the place of the next marker; -1 if more than padding stands before it.

    A byte is filled up with ones; webcams add bytes of zeros.
    """
    place, word, held, spare = _filled(coded, place, word, held, spare)
    word <<= np.uint64((held - spare) & 7)
    while spare == 0 and word == 0:
        place, word, held, spare = _filled(coded, place, word, 0, 0)
    return place if word == 0 else -1


@njit(cache=True)
def _block(
    coded: Bytes, full: Words, short: Words, first: int,
    place: int, word: np.uint64, held: int, spare: int,
) -> tuple[int, np.uint64, int, int]:  # fmt: skip
    """Skip the 64 coefficients of a block; holds less than nothing after a fault."""
    at = 0
    while at < 64:
        if held < 32:
            place, word, held, spare = _filled(coded, place, word, held, spare)
        table = first + (at > 0)
        found = int(short[table, word >> np.uint64(64 - _SHORT)])
        if found == 0 or found >> 8 > _SHORT:
            found = int(full[table, word >> np.uint64(48)])
        length, run, bits = found >> 8, (found >> 4) & 15, found & 15
        word <<= np.uint64(length + bits)
        held -= length + bits
        if length == 0 or held < spare:
            return place, word, -1, 0
        if at == 0:
            at = 1
        elif bits:
            at += run + 1
        elif run == 15:
            at += 16
        else:
            break
    return place, word, held if at <= 64 else -1, spare


@njit(cache=True)
def _filled(
    coded: Bytes, place: int, word: np.uint64, held: int, spare: int
) -> tuple[int, np.uint64, int, int]:
    """Fill a word of 64 bits from its top; `spare` counts zeros past the data's end."""
    while held <= 56:
        value = 0
        last = place + 1 >= coded.size
        if last or (coded[place] == 0xFF and coded[place + 1] not in (0x00, 0xFF)):
            spare += 8
        else:
            value = int(coded[place])
            place += 1
            if value == 0xFF and coded[place] == 0x00:
                place += 1
            elif value == 0xFF:
                continue
        word |= np.uint64(value) << np.uint64(56 - held)
        held += 8
    return place, word, held, spare
