"""A board that can only say what the recorded one said; it knows no GRBL.

Every byte it sends stands in the recording of a real board. What the twin models it
does not model: a test says which recorded lines answer which line of the driver. On
top comes a bad day of the line: answers to ``?`` that are missing, doubled or late, and
everything in shreds of some bytes.
"""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Callable
from pathlib import Path

RECORDING = Path(__file__).parents[2] / "fixtures/rig/grbl_1.1h_dialogue.txt"
REAL_TIME = b"?!~\x18\x85"
Action = Callable[[], None]


def _read() -> dict[str, list[tuple[float, bytes]]]:
    sections: dict[str, list[tuple[float, bytes]]] = {}
    for row in RECORDING.read_text(encoding="utf-8").splitlines():
        if row.startswith("===="):
            said = sections.setdefault(row.split()[1], [])
        elif match := re.match(r"\s*(\d+\.\d+) << (b.*)$", row):
            said.append((float(match[1]), ast.literal_eval(match[2])))
    return sections


def hal_words() -> list[bytes]:
    """Return what the second firmware, a grblHAL, said: section X, one reply a row."""
    section = RECORDING.read_text(encoding="utf-8").split("==== X ")[1]
    found = re.findall(r"<< (b(?:'[^']*'|\"[^\"]*\"))", section)
    return [ast.literal_eval(text) for text in found]


TIMED = _read()
SAID = {name: [data for _, data in said] for name, said in TIMED.items()}


def line(section: str, start: str, number: int = 0) -> bytes:
    """Return the line of a section that starts so; `number` counts from 0."""
    return [s for s in SAID[section] if s.startswith(start.encode())][number]


def listing(query: str) -> list[bytes]:
    """Return what the board answered to a query of section A, with its ``ok``."""
    first, last = {"$I": ("[VER", "[OPT"), "$G": ("[GC", "[GC"),
                   "$#": ("[G54", "[PRB"), "$$": ("$0=", "$132")}[query]  # fmt: skip
    said = SAID["A"]
    begin, end = said.index(line("A", first)), said.index(line("A", last))
    return [*said[begin : end + 1], line("A", "ok")]


class RecordedBoard:
    """What ``twin://`` asks of a board, with the recording's words."""

    def __init__(self, seed: int, report: bytes) -> None:
        self.now_s = 0.0
        self.plugged, self.port_taken, self.restart_on_open = True, False, False
        self.report: bytes | None = report
        self.heard: list[str] = []
        self._dice = random.Random(seed)
        self._due: list[tuple[float, Action]] = []
        self._rules: list[tuple[re.Pattern[str], Action]] = []
        self._line, self._out = b"", bytearray()
        self._sent_s = 0.0
        for query in ("$I", "$G", "$#", "$$"):
            self.on(re.escape(query), lambda query=query: self.say(*listing(query)))
        self.on("\x18", lambda: self.say(*self.banner("C"), after_s=0.04))

    def banner(self, section: str) -> list[bytes]:
        """Return the lines of the last banner, from the empty one on."""
        said = SAID[section]
        begin = len(said) - 1 - said[::-1].index(b"\r\n")
        lines = [said[begin]]
        for text in said[begin + 1 :]:
            if text.startswith((b"<", b"ok")):
                break
            lines.append(text)
        return lines

    def on(self, pattern: str, action: Action) -> None:
        """Do something when a line or real-time byte matches; the latest rule wins."""
        self._rules.insert(0, (re.compile(pattern), action))

    def later(self, after_s: float, action: Action) -> None:
        self._due.append((self.now_s + after_s, action))

    def say(self, *lines: bytes, after_s: float = 0.01) -> None:
        """Send lines; nothing overtakes on a line, so a late one delays the next."""
        self._sent_s = max(self._sent_s, self.now_s + after_s)
        data = b"".join(lines)
        self.later(self._sent_s - self.now_s, lambda: self._out.extend(data))

    def report_as_recorded(self, section: str, first: bytes, last: bytes) -> None:
        """Report what the recorded board reported, each report at its time."""
        rows = TIMED[section]
        said = [data for _, data in rows]
        begin, end = said.index(first), said.index(last)
        for time_s, data in rows[begin : end + 1]:
            if data.startswith(b"<"):
                wait_s = time_s - rows[begin][0]
                self.later(wait_s, lambda data=data: setattr(self, "report", data))

    def advance(self, duration_s: float) -> None:
        end_s = self.now_s + duration_s
        while due := [item for item in self._due if item[0] <= end_s]:
            first = min(due, key=lambda item: item[0])
            self._due.remove(first)
            self.now_s = max(first[0], self.now_s)
            first[1]()
        self.now_s = end_s

    def read(self) -> bytes:
        shred = bytes(self._out[: self._dice.randint(1, 9)])
        del self._out[: len(shred)]
        return shred

    def receive(self, data: bytes) -> None:
        for byte in data:
            if byte in REAL_TIME:
                self._take(chr(byte))
            elif byte in b"\r\n":
                self._take(self._line.decode())
                self._line = b""
            else:
                self._line += bytes([byte])

    def _take(self, text: str) -> None:
        self.heard.append(text)
        if text == "?":
            self._answer()
            return
        for pattern, action in self._rules:
            if pattern.fullmatch(text):
                action()
                return

    def _answer(self) -> None:
        """Report. One answer in four is missing, some are double, some late."""
        if self.report is None or self._dice.random() < 0.25:
            return
        times = 2 if self._dice.random() < 0.15 else 1
        late_s = 0.4 if self._dice.random() < 0.1 else 0.0
        self.say(
            *[self.report] * times, after_s=self._dice.uniform(0.005, 0.03) + late_s
        )
