"""The twin bench: a hidden true rod before a hidden true magnet, photographed.

The rig package has devices without physics, the vision package a camera without rods,
the simulator rods without devices. Here they become one bench: the stage's gap decides
the field, the field bends the true rod, and the camera photographs it. The truth
differs from the nominal specimen and magnet by a seeded hidden amount, so that
comparing and fitting have something to find.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...core.magnet import Magnet, Vector
from ...core.specimen import Specimen
from ...sim import MagnetField, Solution, Support, magnet_flux_mT, solve
from ...vision import Board, Pose
from ...vision.synthetic import (
    Block,
    Scene,
    SceneLight,
    expose,
    paint_scene,
    render_board,
    scene_camera,
)

LIGHT = SceneLight()
_MIDDLE_GAP_MM = 60.0
"""The gap at which the rod lies in the middle of the picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenTruth:
    """What the twin bench really is; nobody but tests may look.

    Parameters
    ----------
    specimen : Specimen
        The true rod: moduli differ from the nominal ones.
    magnet : Magnet
        The true magnet: remanence and pose differ.
    clamp_angle_deg : float
        How far the clamp is turned from the nominal x axis, counter-clockwise.
    gap_mm : float
        How much farther than the stage says the magnet stands.
    meter_gain, meter_offset_mT : float
        What the Tesla-meter makes of a flux density.
    """

    specimen: Specimen
    magnet: Magnet
    clamp_angle_deg: float
    gap_mm: float = 0.0
    meter_gain: float = 1.0
    meter_offset_mT: float = 0.0


def hide(nominal: Specimen, magnet: Magnet, *, seed: int) -> HiddenTruth:
    """Return a truth near the nominal bench, drawn from a seed.

    Moduli differ by 8 % (one standard deviation, log-normal, each section by itself),
    the magnet's remanence by 1 %, its axis by 0.5 deg and 0.5 mm, and the clamp by
    0.4 deg: what a careful bench may have and not know.
    """
    rng = np.random.default_rng(seed)
    sections = tuple(
        replace(section, E_MPa=section.E_MPa * math.exp(0.08 * rng.standard_normal()))
        for section in nominal.sections
    )
    shift_x, shift_y = 0.5 * rng.standard_normal(2)
    true_magnet = replace(
        magnet,
        remanence_T=magnet.remanence_T * (1.0 + 0.01 * rng.standard_normal()),
        axis_angle_deg=magnet.axis_angle_deg + 0.5 * rng.standard_normal(),
        offset_mm=(
            magnet.offset_mm[0] + shift_x,
            magnet.offset_mm[1] + shift_y,
            magnet.offset_mm[2],
        ),
    )
    return HiddenTruth(
        specimen=replace(nominal, sections=sections),
        magnet=true_magnet,
        clamp_angle_deg=0.4 * rng.standard_normal(),
    )


class TwinBench:
    """The bench that the twin's devices look at.

    Parameters
    ----------
    specimen : Specimen
        The nominal rod.
    magnet : Magnet
        The nominal magnet.
    seed : int
        Which hidden truth, which sheet of paper, which noise.
    truth : HiddenTruth, optional
        Given in place of the seeded one by tests that know what they hide.
    side_up_mm : float
        Clearance between the rod's lower face and the paper.
    gravity_m_s2 : tuple of float
        Free fall (x, y, z) in the specimen frame; it needs the rod's density.

    Attributes
    ----------
    shows_board : bool
        Whether the calibration board lies under the camera in place of rod and clamp.
    exposures : int or None
        After so many pictures of a still scene they come round again, noise and all: a
        live view costs no more. None makes every picture anew.
    """

    def __init__(
        self,
        specimen: Specimen,
        magnet: Magnet,
        *,
        seed: int,
        truth: HiddenTruth | None = None,
        side_up_mm: float = 0.4,
        gravity_m_s2: Vector = (0.0, 0.0, 0.0),
    ) -> None:
        self.specimen = specimen
        self.magnet = magnet
        self.truth = truth or hide(specimen, magnet, seed=seed)
        self.board = Board()
        self.axis_height_mm = side_up_mm + specimen.side_mm / 2.0
        self._seed = seed
        self._support = Support(
            clamp_angle_deg=self.truth.clamp_angle_deg, gravity_m_s2=gravity_m_s2
        )
        self._noise = np.random.default_rng([seed, 1])
        direction = math.radians(magnet.axis_angle_deg)
        self._approach = (-math.cos(direction), -math.sin(direction))
        # The wider of the two: a long rod needs a camera farther up.
        span_mm = max(58.0, 1.6 * specimen.length_mm)
        self._camera = scene_camera(height_mm=330.0 * span_mm / 58.0, tilt_deg=1.5)
        self._painted: tuple[object, NDArray[np.float32]] | None = None
        self._exposed: list[NDArray[np.uint8]] = []
        self._turn = 0
        self.shows_board = False
        self.exposures: int | None = None

    def solution(self, gap_mm: float) -> Solution:
        """Return the true equilibrium at a gap."""
        return solve(
            self.truth.specimen,
            MagnetField(magnet=self.truth.magnet, gap_mm=gap_mm + self.truth.gap_mm),
            support=self._support,
            points=241,
        )

    def flux_mT(self, gap_mm: float) -> float:
        """Return the flux density in mT at the undeformed tip, along the nominal axis.

        The probe replaces the rod: it stands where the undeformed tip would be.
        """
        length_mm = self.specimen.length_mm
        tip = np.array([[length_mm, 0.0, 0.0]])
        truth = self.truth
        flux = magnet_flux_mT(
            truth.magnet, tip, length_mm=length_mm, gap_mm=gap_mm + truth.gap_mm
        )[0]
        # The approach points toward the magnet, the nominal flux away from it.
        along_mT = -(flux[0] * self._approach[0] + flux[1] * self._approach[1])
        return float(truth.meter_gain * along_mT + truth.meter_offset_mT)

    def photograph(self, gap_mm: float, time_s: float) -> NDArray[np.uint8]:
        """Return the picture, shape (h, w, 3), that the top camera takes at a gap.

        Only the sensor's noise differs between two pictures of a still rod.
        """
        del time_s
        if self.shows_board:
            return self.photograph_board()
        state = self._state(gap_mm)
        if self._painted is None or self._painted[0] != state:
            self._painted = (state, paint_scene(self._scene(gap_mm), self._camera))
            self._exposed = []
        if self.exposures is not None and len(self._exposed) >= self.exposures:
            self._turn = (self._turn + 1) % self.exposures
            return self._exposed[self._turn]
        picture = expose(self._painted[1], LIGHT, self._noise)
        self._exposed = [*self._exposed, picture] if self.exposures else []
        return picture

    def stills(self) -> dict[str, NDArray[np.uint8]]:
        """Return the pictures that a run's folder gets beside its own, by file name."""
        return {"board.png": self.photograph_board()}

    def photograph_board(self) -> NDArray[np.uint8]:
        """Return the same camera's picture of the calibration board on the paper."""
        return render_board(
            self.board, self._camera, self._noise, light=LIGHT, paper_seed=self._seed
        )

    def _state(self, gap_mm: float) -> object:
        """Return what the picture of a still scene depends on."""
        return gap_mm

    def _scene(self, gap_mm: float) -> Scene:
        # The camera stands still beside the magnet; the platform moves toward it.
        travelled_mm = _MIDDLE_GAP_MM - gap_mm
        pose = Pose(
            x_mm=35.0 - 0.62 * self.specimen.length_mm
            + travelled_mm * self._approach[0],
            y_mm=-30.0 + travelled_mm * self._approach[1],
            angle_deg=0.0,
            height_mm=self.axis_height_mm,
        )  # fmt: skip
        return Scene(
            clamp=Block(pose=pose),
            centreline=self.solution(gap_mm).centreline,
            side_mm=self.truth.specimen.side_mm,
            light=LIGHT,
            paper_seed=self._seed,
        )
