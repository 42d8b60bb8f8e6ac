"""Every command with its source, one JSON line each, beside the rig file."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

JOURNAL_FILE = "panel-log.jsonl"


class Journal:
    """The log of commands; safe from any thread.

    Parameters
    ----------
    folder : Path
        Where ``panel-log.jsonl`` goes.
    now_utc : callable
        Time of day, as text.
    """

    def __init__(self, folder: Path, now_utc: Callable[[], str]) -> None:
        self.path = folder / JOURNAL_FILE
        self._now_utc = now_utc
        self._lock = threading.Lock()
        self.trouble = ""

    def write(
        self, source: str, command: str, arguments: Mapping[str, Any], outcome: str
    ) -> None:
        """Append a line; a full disk is told on the page and stops no stop."""
        line = json.dumps(
            {
                "time_utc": self._now_utc(),
                "source": source,
                "command": command,
                "arguments": dict(arguments),
                "outcome": outcome,
            },
            ensure_ascii=False,
            default=str,
        )
        with self._lock:
            try:
                with self.path.open("a", encoding="utf-8") as file:
                    file.write(line + "\n")
            except OSError as error:
                self.trouble = f"{self.path}: cannot be written: {error.strerror}"
            else:
                self.trouble = ""
