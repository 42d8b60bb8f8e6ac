"""What a bench is made of: paper, clamp, rods, marks, lamps, and the camera above.

Lengths are mm in the board frame of the camera's calibration, whose plane z = 0 is the
paper. Colours are reflectances in blue, green, red, from 0 to 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ..camera.board import marker_polygons
from ..camera.calibration import Calibration
from ..camera.clamp_tag import ClampTag
from ..measurement import Pose

Array = NDArray[np.float64]

Colour = tuple[float, float, float]

GREY: Colour = (0.21, 0.20, 0.20)

BLUE: Colour = (0.42, 0.13, 0.05)

BLACK: Colour = (0.045, 0.045, 0.045)

PAPER: Colour = (0.70, 0.71, 0.71)

RUBBER: Colour = (0.048, 0.048, 0.048)

INK: Colour = (0.035, 0.035, 0.035)

PRINT: Colour = (0.40, 0.38, 0.36)


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A box standing on the paper: the printed clamp, or a magnet at the edge.

    Parameters
    ----------
    pose : Pose
        Middle of its front edge, and the direction its front face looks.
    length_mm, width_mm, height_mm : float
        Back from the front face, across, and above the paper.
    colour : tuple of float
        Reflectance in blue, green, red, from 0 to 1.
    screws_mm : tuple of float
        Distances of screw heads behind the front face.
    label : Label, optional
        A printed tag on its top.
    skew_deg : float
        By how much it is turned about the middle of its front, away from `pose`: no
        clamp is made quite square to its rod.
    """

    pose: Pose
    length_mm: float = 60.0
    width_mm: float = 10.0
    height_mm: float = 4.0
    colour: Colour = GREY
    screws_mm: tuple[float, ...] = (6.0, 16.0)
    label: Label | None = None
    skew_deg: float = 0.0

    def to_board(self, points_mm: Array) -> Array:
        """Return where on the board what is told in its own frame lies, (n, 2)."""
        turned = self.pose.angle_deg + self.skew_deg
        return replace(self.pose, angle_deg=turned).to_board(points_mm)


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A printed tag, cut out with a white margin of a cell and glued on a block.

    Parameters
    ----------
    tag : ClampTag
        Which marker, and its side.
    x_mm, y_mm, angle_deg : float
        Its middle and the direction of its x axis, in the frame of the block.
    """

    tag: ClampTag
    x_mm: float
    y_mm: float = 0.0
    angle_deg: float = 0.0

    @property
    def sheet_mm(self) -> Array:
        """Corners of the paper, shape (4, 2), in the frame of the block."""
        half = self.tag.side_mm * (0.5 + 1.0 / 6.0)
        corners = np.array([[half, half], [half, -half], [-half, -half], [-half, half]])
        return self._place.to_board(corners)

    def black_polygons(self) -> tuple[list[Array], list[int]]:
        """Return what is printed black, as `Board.black_polygons` does."""
        side = self.tag.side_mm
        inked, signs = marker_polygons(
            self.tag.dictionary, self.tag.number, (-0.5 * side, -0.5 * side), side
        )
        return [self._place.to_board(outline) for outline in inked], signs

    @property
    def _place(self) -> Pose:
        # Printed, x runs right; in the tag's frame it runs up.
        return Pose(x_mm=self.x_mm, y_mm=self.y_mm, angle_deg=self.angle_deg - 90.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneLight:
    """Lamps, lens and sensor; levels are linear.

    Parameters
    ----------
    shadow_direction_deg : float
        Where shadows fall, counter-clockwise from the board's +x.
    shadow_depth : float
        Share of the light that the lamp behind the shadows gives.
    slope : float
        How far a shadow lies from its object, in mm per mm of height.
    softness : float
        Standard deviation of the shadow's edge, in mm per mm of height.
    gradient, vignette : float
        Loss of light across the picture, and toward its corners, relative.
    gloss : float
        Light added by a highlight on the rod, at its middle third.
    blur_px, noise : float
        Standard deviations of the lens blur, and of the noise on white paper.
    exposure : float
        Factor on all light: above 1.4 white paper is clipped.
    motion_px : tuple of float
        How far the picture moves while the shutter is open, right and down.
    """

    shadow_direction_deg: float = -40.0
    shadow_depth: float = 0.35
    slope: float = 0.7
    softness: float = 0.25
    gradient: float = 0.10
    vignette: float = 0.05
    gloss: float = 0.0
    blur_px: float = 0.7
    noise: float = 0.006
    exposure: float = 1.0
    motion_px: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rod:
    """A square rod that lies above the paper.

    Parameters
    ----------
    line : Centreline
        Its axis, in the frame that `pose` places on the board.
    pose : Pose
        Where; `pose.height_mm` is the height of the axis above the paper.
    side_mm : float
        Side of its section.
    colour : tuple of float
        Of the whole rod, or of its first stripe.
    stripe : tuple of float, optional
        Every other piece of `stripe_mm` has this colour.
    stripe_mm : float
        Length of a piece.
    """

    line: Centreline
    pose: Pose
    side_mm: float = 1.0
    colour: Colour = RUBBER
    stripe: Colour | None = None
    stripe_mm: float = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """Something flat on the paper: a line, a strip of shade, another sheet.

    Parameters
    ----------
    outline_mm : ndarray, shape (n, 2)
        Its corners on the board.
    colour : tuple of float
        What it leaves of the paper's light in blue, green, red, where it covers it.
    cover : float
        How much of the paper it covers, from 0 to 1.
    softness_mm : float
        Standard deviation of its edge.
    """

    outline_mm: Array
    colour: Colour = (0.02, 0.02, 0.02)
    cover: float = 1.0
    softness_mm: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ridge:
    """A wall of a printed channel, standing on the paper.

    Parameters
    ----------
    face_mm, back_mm : ndarray, shape (n, 2)
        Along the face that the rod may touch, and behind it, on the board.
    height_mm : float
        Above the paper.
    colour : tuple of float
        Reflectance in blue, green, red, from 0 to 1.
    """

    face_mm: Array
    back_mm: Array
    height_mm: float = 1.4
    colour: Colour = PRINT


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What lies on the paper.

    Parameters
    ----------
    clamp : Block
        Its pose is where the rod leaves it; `pose.height_mm` is the height of the rod's
        axis above the paper.
    centreline : Centreline or None
        The rod's axis in the specimen frame; None leaves the clamp empty.
    side_mm : float
        Side of the square rod.
    blocks : tuple of Block
        Other things on the paper.
    light : SceneLight
        Lamps, lens and sensor.
    dust : int
        Number of specks on the paper.
    paper_seed : int
        Which sheet of paper it is: the same seed has the same fibres and specks.
    paper, rod_colour : tuple of float
        Their colours.
    rod_stripe : tuple of float, optional
        See `Rod`.
    marks : tuple of Mark
        What is printed or drawn on the paper, or falls on it.
    others : tuple of Rod
        Other rods beside the one in the clamp.
    ridges : tuple of Ridge
        Walls of a channel, of one colour.
    """

    clamp: Block
    centreline: Centreline | None = None
    side_mm: float = 1.0
    blocks: tuple[Block, ...] = ()
    light: SceneLight = field(default_factory=SceneLight)
    dust: int = 12
    paper_seed: int = 0
    paper: Colour = PAPER
    rod_colour: Colour = RUBBER
    rod_stripe: Colour | None = None
    marks: tuple[Mark, ...] = ()
    others: tuple[Rod, ...] = ()
    ridges: tuple[Ridge, ...] = ()

    @property
    def rods(self) -> tuple[Rod, ...]:
        """All rods, that in the clamp last."""
        if self.centreline is None:
            return self.others
        held = Rod(
            line=self.centreline, pose=self.clamp.pose, side_mm=self.side_mm,
            colour=self.rod_colour, stripe=self.rod_stripe,
        )  # fmt: skip
        return (*self.others, held)


def scene_camera(
    *,
    size_px: tuple[int, int] = (1600, 1200),
    focal_px: float = 6800.0,
    height_mm: float = 330.0,
    tilt_deg: float = 1.5,
    tilt_direction_deg: float = 60.0,
    turn_deg: float = 0.0,
    target_mm: tuple[float, float] = (35.0, -25.0),
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0),
) -> Calibration:
    """Return the exact calibration of a camera above the paper.

    Parameters
    ----------
    size_px : tuple of int
        Width and height of its pictures.
    focal_px : float
        Focal length in pixels.
    height_mm : float
        Distance from the camera to the point it looks at.
    tilt_deg, tilt_direction_deg : float
        Angle of its axis from the vertical, and toward where the camera is moved.
    turn_deg : float
        Turn of the picture about the axis.
    target_mm : tuple of float
        The point it looks at, in the board frame.
    distortion : tuple of float
        k1, k2, p1, p2, k3.
    """
    tilt, toward, turn = np.radians([tilt_deg, tilt_direction_deg, turn_deg])
    backward = np.array(
        [
            math.sin(tilt) * math.cos(toward),
            math.sin(tilt) * math.sin(toward),
            math.cos(tilt),
        ]
    )
    up = np.array([-math.sin(turn), math.cos(turn), 0.0])
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(right, backward), -backward])
    camera = np.array([*target_mm, 0.0]) + height_mm * backward
    width, height = size_px
    return Calibration(
        image_size_px=size_px,
        focal_px=(focal_px, focal_px),
        centre_px=((width - 1) / 2.0, (height - 1) / 2.0),
        distortion=distortion,
        rotation=rotation,
        translation_mm=-rotation @ camera,
        camera_height_sd_mm=0.0,
        camera_height_source="exact",
        scale_relative_sd=0.0,
        rms_px=0.0,
        board="exact",
    )
