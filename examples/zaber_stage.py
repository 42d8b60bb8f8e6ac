"""A stage of another maker: one axis of a two-axis Zaber controller (ASCII protocol).

A package declares it, and a rig file names it:

    [project.entry-points."magbend.stages"]
    zaber = "my_package:ZaberStage"

    [stage]
    driver = "zaber"
    baud = 115200
    [stage.options]
    axis = 2
    microstep_um = 0.49609375

The controller answers ``@01 2 OK IDLE -- 1000``: device, axis, whether it obeyed and
moves, its worst warning, the data. Positions are microsteps; ``maxspeed`` is their
number a second times 1.6384, ``accel`` that a second squared times 1.6384e-4 (Zaber's
ASCII Protocol Manual, "Units" and "Message format"). ``WR`` warns that the axis has no
reference: it restarted.
"""

from __future__ import annotations

from pydantic import BaseModel, Field

from magbend.core import StageError
from magbend.rig import Answer, Link, PolledStage, StageIdentity, StageLimits

AXES = 2


class ZaberStage(PolledStage):
    """Axis `axis` of the controller; the other one stays where it is."""

    class Options(BaseModel):
        """The keys of ``[stage.options]``."""

        axis: int = Field(default=1, ge=1, le=AXES)
        microstep_um: float = Field(gt=0.0)

    options: Options

    @property
    def axis_index(self) -> int:
        """Which of the controller's places is this stage's."""
        return self.options.axis - 1

    def introduce(self, link: Link) -> tuple[StageIdentity, StageLimits]:
        """Ask for version, limits, speed and acceleration."""
        version = self._data(link, "get version")
        names = ("limit.min", "limit.max", "maxspeed", "accel")
        settings = {name: self._data(link, f"get {name}") for name in names}
        low, high, speed, acceleration = (float(settings[name]) for name in names)
        step_mm = 1e-3 * self.options.microstep_um
        identity = StageIdentity(
            driver="zaber", firmware=f"Zaber {version}", port=link.port,
            settings=settings,
        )  # fmt: skip
        return identity, StageLimits(
            step_mm=step_mm,
            max_feed_mm_min=60.0 * step_mm * speed / 1.6384,
            acceleration_mm_s2=step_mm * acceleration / 1.6384e-4,
            travel_mm=(low * step_mm, high * step_mm),
        )

    def ask(self, link: Link) -> Answer:
        """Ask for the position of both axes; without a reference it restarted."""
        words = self._say(link, "get pos", axis=0)
        if words[4] == "WR" and self._had_reference:
            self._restarts, self._had_reference = self._restarts + 1, False
        elif words[4] != "WR":
            self._had_reference = True
        step_mm = 1e-3 * self.options.microstep_um
        places = tuple(step_mm * float(word) for word in words[5:])
        return Answer(places, words[3] == "BUSY", self._restarts)

    _restarts = 0
    _had_reference = False

    def begin(self, link: Link, target_mm: float, feed_mm_min: float) -> None:
        """Set the speed and begin an absolute move."""
        step_mm = 1e-3 * self.options.microstep_um
        speed = feed_mm_min / 60.0 / step_mm * 1.6384
        self._say(link, f"set maxspeed {speed:.0f}")
        self._say(link, f"move abs {target_mm / step_mm:.0f}")

    def slow(self, link: Link) -> None:
        """Slow down with the acceleration that is set."""
        self._say(link, "stop")

    def halt(self, link: Link) -> None:
        """Stop at once."""
        self._say(link, "estop")

    def seek_home(self, link: Link) -> None:
        """Seek the home sensor of this axis."""
        self._say(link, "home")

    def _data(self, link: Link, question: str) -> str:
        return self._say(link, question)[5]

    def _say(self, link: Link, command: str, axis: int | None = None) -> list[str]:
        """Send a command to this axis; return the words of its reply."""
        number = self.options.axis if axis is None else axis
        link.waiting_lines()  # alerts, and answers that came too late
        link.write(f"/1 {number} {command}\n".encode("ascii"))
        for _ in range(10):
            line = link.read_line(self._config.answer_timeout_s)
            if line is None:
                break
            words = line.split()
            if not line.startswith("@") or len(words) < 6:
                continue
            if words[2] != "OK":
                raise StageError(f"the stage refused {command!r}: {words[5]}")
            return words
        raise self.no_answer(command)
