"""The tables of a batch so far: written whole from time to time, taken up again."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Mapping
from pathlib import Path

from ...core.files import write_text
from . import tables
from .inputs import Source, digest
from .run_frame import in_own_frame, in_run_frames
from .tables import Done

STATE_FILE = "extract.json"
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
        self.done[done.image] = done
        now = time.monotonic()
        if now > self._next_write:
            self.write()
            took = time.monotonic() - now
            self._next_write = now + max(_CHECKPOINT_S, 20.0 * took)

    def write(self) -> None:
        """Write all tables; the state goes last and names only what they hold."""
        ready = in_run_frames(
            (self.done[image] for image in self._order if image in self.done),
            self._runs,
        )
        write_text(
            self._out / "centrelines.csv",
            tables.header(tables.CENTRELINE_HEADER)
            + "".join(done.centreline for done in ready),
        )
        write_text(
            self._out / "frames.csv",
            tables.header(tables.FRAME_HEADER) + "".join(done.frame for done in ready),
        )
        if self._edges is not None:
            write_text(
                self._edges,
                tables.header(tables.EDGE_HEADER)
                + "".join(done.edges for done in ready),
            )
        state = {
            "schema": _SCHEMA,
            "settings_sha256": self._settings,
            "edges": self._edges is not None,
            "images": {done.image: done.sha256 for done in ready},
        }
        write_text(self._out / STATE_FILE, json.dumps(state, indent=1) + "\n")

    def load(self, sources: list[Source]) -> None:
        """Take over what an earlier call with the same settings has finished."""
        try:
            state = json.loads((self._out / STATE_FILE).read_text(encoding="utf-8"))
            images = dict(state["images"])
            if (state["schema"], state["settings_sha256"]) != (_SCHEMA, self._settings):
                return
            if self._edges is not None and not state["edges"]:
                return
            frames = _lines_by_image(self._out / "frames.csv")
            centrelines = _lines_by_image(self._out / "centrelines.csv")
            edges = {} if self._edges is None else _lines_by_image(self._edges)
            held = {
                name: in_own_frame(
                    Done(
                        name, sha256, frames[name],
                        centrelines.get(name, ""), edges.get(name, ""),
                    )
                )
                for name, sha256 in images.items()
                if sha256 and name in frames
            }  # fmt: skip
        except (OSError, ValueError, KeyError, TypeError):
            return
        for source in sources:
            done = held.get(source.image)
            if done and source.path.exists() and done.sha256 == digest(source):
                self.done[source.image] = done


def _lines_by_image(path: Path) -> dict[str, str]:
    """Return the lines of a table grouped by its first column."""
    groups: dict[str, list[str]] = {}
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    for line in lines[1:]:
        image = next(iter(_first_cell(line)), "")
        groups.setdefault(image, []).append(line)
    return {image: "".join(held) for image, held in groups.items()}


def _first_cell(line: str) -> list[str]:
    return next(csv.reader([line]), [])[:1]
