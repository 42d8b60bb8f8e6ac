"""The twin with a printed channel under its camera: a rod is fed in, and photographed.

Plate and camera stand still, the stage carries the magnet; the axes ``insertion_mm``
and, if there is one, ``axis_angle_deg`` (the magnet goes round the point that its gap
counts from) are the rig's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import RigError
from ...core.magnet import Magnet
from ...core.specimen import Specimen
from ...sim import MagnetField
from ...sim.navigate import Lumen, moving, navigate, outline
from ...sim.navigate import Step as LumenStep
from ...vision import Pose
from ...vision.synthetic import Block, Scene, expose, paint_scene, scene_camera
from .bench import LIGHT, HiddenTruth, TwinBench
from .channel import ridges_of

FRICTION = 0.1
"""Coefficient of the twin's walls, which nobody knows."""
PLACE_MM, TURN_DEG = 0.3, 0.4
"""How well the plate is put where it was to be, one standard deviation."""
STEP_MM = 0.5
GUIDE_MM = 10.0
"""What of the guide is to be seen before the channel."""


class Axis(Protocol):
    """What the bench asks of an axis: where it is."""

    @property
    def value(self) -> float | None:
        """The last value that was set."""
        ...


class LumenBench(TwinBench):
    """A twin bench whose rod is fed through a printed channel.

    Parameters
    ----------
    specimen, magnet, seed, truth, side_up_mm
        As of `TwinBench`.
    lumen : Lumen
        The channel, in the specimen's frame.
    wall_height_mm : float
        Of its walls above the paper.

    Attributes
    ----------
    axes : mapping of str to Axis
        Those of the rig that is open; the first time it is photographed the rod must
        have been fed in.
    pose : Pose
        Where the plate truly lies on the board; nobody but tests may look.
    """

    def __init__(
        self,
        specimen: Specimen,
        magnet: Magnet,
        lumen: Lumen,
        *,
        seed: int,
        wall_height_mm: float,
        truth: HiddenTruth | None = None,
        side_up_mm: float = 0.4,
    ) -> None:
        super().__init__(
            specimen, magnet, seed=seed, truth=truth, side_up_mm=side_up_mm
        )
        self.lumen = lumen
        self.axes: Mapping[str, Axis] = {}
        self._poses: list[dict[str, float]] = []
        self._resting: tuple[object, LumenStep] | None = None
        points = np.concatenate([outline(wall.arcs) for wall in lumen.walls])
        ahead = math.radians(lumen.entry_angle_deg)
        back = GUIDE_MM * np.array([math.cos(ahead), math.sin(ahead)])
        points = np.vstack([points, np.subtract(lumen.entry_mm, back)])
        low, high = points.min(axis=0), points.max(axis=0)
        wide, tall = high - low + 8.0
        span_mm = max(58.0, tall, 0.75 * wide)
        self._camera = scene_camera(height_mm=330.0 * span_mm / 58.0, tilt_deg=1.5)
        rng = np.random.default_rng([seed, 2])
        x_mm, y_mm = np.array([35.0, -25.0]) - 0.5 * (low + high)
        self.pose = Pose(
            x_mm=x_mm + PLACE_MM * rng.standard_normal(),
            y_mm=y_mm + PLACE_MM * rng.standard_normal(),
            angle_deg=TURN_DEG * rng.standard_normal(),
            height_mm=self.axis_height_mm,
        )
        self._ridges = ridges_of(lumen, self.pose, wall_height_mm)

    def stills(self) -> dict[str, NDArray[np.uint8]]:
        """Return the pictures of the board, and of the channel without its rod."""
        painted = paint_scene(self._laid(None), self._camera)
        return {**super().stills(), "bare.png": expose(painted, LIGHT, self._noise)}

    def resting(self, gap_mm: float) -> LumenStep:
        """Return the true rod at rest, as far as it is fed in now.

        Raises
        ------
        RigError
            If it is not fed in, or was pulled back: the twin's walls rub, and its way
            back is not computed.
        """
        state = self._state(gap_mm)
        if self._resting is None or self._resting[0] != state:
            self._resting = state, self._moved(gap_mm)
        return self._resting[1]

    def _state(self, gap_mm: float) -> object:
        return (gap_mm, *(axis.value for axis in self.axes.values()))

    def _moved(self, gap_mm: float) -> LumenStep:
        """Push the rod on to where the axes are now; the field changes on the way."""
        at = {name: axis.value for name, axis in self.axes.items()}
        insertion_mm = at.get("insertion_mm")
        last_mm = self._poses[-1]["insertion_mm"] if self._poses else 0.0
        if insertion_mm is None or insertion_mm < last_mm:
            raise RigError(
                "insertion_mm must be set, and never fall, on the computed bench; "
                f"instead it is {insertion_mm} mm after {last_mm:g} mm"
            )
        pose = {"insertion_mm": insertion_mm, "gap_mm": gap_mm + self.truth.gap_mm}
        turned = at.get("axis_angle_deg")
        if "axis_angle_deg" in at:
            nominal = self.magnet.axis_angle_deg if turned is None else turned
            off = self.truth.magnet.axis_angle_deg - self.magnet.axis_angle_deg
            pose["axis_angle_deg"] = nominal + off
        if insertion_mm == last_mm:
            self._poses.pop()
        self._poses.append(pose)
        field = MagnetField(magnet=self.truth.magnet, gap_mm=pose["gap_mm"])
        passage = navigate(
            self.truth.specimen, self.lumen, moving(field, self._poses),
            way_mm=insertion_mm, step_mm=STEP_MM, friction=FRICTION, refine=False,
        )  # fmt: skip
        return passage.steps[-1]

    def _scene(self, gap_mm: float) -> Scene:
        return self._laid(self.resting(gap_mm))

    def _laid(self, step: LumenStep | None) -> Scene:
        """Return the plate on the paper, with the rod in the guide's frame."""
        lumen = self.lumen
        entry = Pose(
            x_mm=lumen.entry_mm[0],
            y_mm=lumen.entry_mm[1],
            angle_deg=lumen.entry_angle_deg,
        )
        ((x_mm, y_mm),) = self.pose.to_board(np.array([lumen.entry_mm]))
        guide = replace(
            self.pose, x_mm=float(x_mm), y_mm=float(y_mm),
            angle_deg=self.pose.angle_deg + lumen.entry_angle_deg,
        )  # fmt: skip
        line = None
        if step is not None:
            xy = entry.from_board(step.shape[:2].T)
            line = Centreline(
                s_mm=step.s_mm,
                x_mm=xy[:, 0],
                y_mm=xy[:, 1],
                theta_rad=step.shape[2] - math.radians(lumen.entry_angle_deg),
                kappa_per_mm=step.shape[3],
            )
        return Scene(
            clamp=Block(pose=guide),
            centreline=line,
            side_mm=self.truth.specimen.side_mm,
            light=LIGHT,
            paper_seed=self._seed,
            ridges=self._ridges,
        )
