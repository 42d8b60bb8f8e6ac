"""The tables of a batch so far: written whole from time to time, taken up again."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...core.derived import file_digest
from ...core.errors import MagbendError
from ...core.files import write_text
from ...core.json import read_json, write_json
from . import tables
from .inputs import Source, digest
from .run_frame import in_own_frame, in_run_frames
from .tables import Done

_log = logging.getLogger(__name__)

STATE_FILE = "extract.json"
_TABLES = ("centrelines.csv", "frames.csv")
_SCHEMA = 2
_CHECKPOINT_S = 20.0


class State:
    """The tables so far; written whole from time to time, and at the end.

    `done` holds every photograph in its own frame; the tables have those of a run
    (`runs`, by image) in the frame of its one clamp.
    """

    def __init__(
        self, out: Path, edges: Path | None, settings: str, order: list[str],
        runs: Mapping[str, str],
    ) -> None:  # fmt: skip
        self._out, self._edges, self._settings = out, edges, settings
        self._order, self._runs = order, runs
        self._next_write = time.monotonic() + _CHECKPOINT_S
        self.done: dict[str, Done] = {}

    def add(self, done: Done) -> None:
        """Take a result; write a checkpoint if the last one is long ago."""
        self.done[done.row.image] = done
        now = time.monotonic()
        if now > self._next_write:
            self.write()
            took = time.monotonic() - now
            self._next_write = now + max(_CHECKPOINT_S, 20.0 * took)

    def write(self) -> list[Done]:
        """Write all tables; the state goes last and names only what they hold.

        Return that: the photographs of a run in one frame.
        """
        held = [self.done[image] for image in self._order if image in self.done]
        ready = in_run_frames(held, self._runs)
        write_text(self._out / "centrelines.csv", tables.write_centrelines(ready))
        frames = tables.write_frames(done.row for done in ready)
        write_text(self._out / "frames.csv", frames)
        if self._edges is not None:
            write_text(self._edges, tables.write_edges(ready))
        state = {
            "schema": _SCHEMA,
            "settings_sha256": self._settings,
            "edges": self._edges is not None,
            "images": {done.row.image: done.sha256 for done in ready},
            "tables": {name: file_digest(self._out / name) for name in _TABLES},
        }
        write_json(self._out / STATE_FILE, state, indent=1)
        return ready

    @property
    def tables(self) -> list[Path]:
        """The tables that each batch has."""
        return [self._out / name for name in _TABLES]

    @property
    def files(self) -> list[Path]:
        """The files that `write` writes."""
        edges = [self._edges] if self._edges is not None else []
        return [*self.tables, self._out / STATE_FILE, *edges]

    def load(self, sources: list[Source]) -> None:
        """Take over what an earlier call with the same settings has finished."""
        try:
            state = read_json(self._out / STATE_FILE)
            digests = dict(state["images"])
            if self._is_edited(state.get("tables") or {}):
                return
            if (state["schema"], state["settings_sha256"]) != (_SCHEMA, self._settings):
                return
            if self._edges is not None and not state["edges"]:
                return
            held = self._held(digests)
        except (MagbendError, OSError, ValueError, KeyError, TypeError):
            return
        for source in sources:
            done = held.get(source.image)
            if done and source.path.exists() and done.sha256 == digest(source):
                self.done[source.image] = done

    def _is_edited(self, tables: Mapping[str, str]) -> bool:
        """Return whether somebody changed the tables; then all is measured anew."""
        edited = [
            name for name, sha in tables.items() if file_digest(self._out / name) != sha
        ]
        for name in edited:
            _log.warning("%s was edited: all is measured anew", self._out / name)
        return bool(edited)

    def _held(self, digests: Mapping[str, str]) -> dict[str, Done]:
        """Return what the tables on the disk hold, each in its own frame."""
        lines = tables.read_centrelines(self._out / "centrelines.csv")
        edges = {} if self._edges is None else tables.read_edges(self._edges)
        held = {}
        for row in tables.read_frames(self._out / "frames.csv"):
            if not digests.get(row.image):
                continue
            done = Done(
                row=row, sha256=digests[row.image], points=lines.get(row.image, {}),
                edges=edges.get(row.image, np.empty((0, 6))),
            )  # fmt: skip
            held[row.image] = in_own_frame(done)
        return held
