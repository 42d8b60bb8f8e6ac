"""Photographs of bent rods with an exactly known truth, to measure the measuring.

Everything is drawn in linear light with exact area coverage (`raster.coverage`): a dark
rod with flat ends leaves a grey clamp block on white paper, seen squarely; then
uneven light, the rod's soft shadow, the blur of a lens and the noise of a sensor; last
the sRGB curve and 8 bits, as a camera writes them. The truth is the axis in pixels
and in mm, its width, its tip and its clamp point. `scene` draws the perspective,
texture and side faces of a real bench instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.checks import positive
from ...core.errors import InputError
from ..camera.calibration import Calibration, scale_calibration
from ..measurement import Pose
from ..picture.raster import coverage, strip
from ..picture.srgb import encode_srgb

Array = NDArray[np.float64]
Kind = Literal["straight", "arc", "s", "graded"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """How a synthetic frame is lit and recorded; levels are linear, from 0 to 1.

    Parameters
    ----------
    paper, rod, clamp : float
        Reflected light of each; swap paper and rod for light on dark.
    gradient : float
        Loss of light from one corner to the other, relative.
    shadow_depth, shadow_sd_mm, shadow_offset_mm : float
        Depth of the rod's shadow on the paper, its softness and its shift.
    blur_px, noise : float
        Standard deviations of the lens blur and of the noise in linear light.
    """

    paper: float = 220.0 / 255.0
    rod: float = 30.0 / 255.0
    clamp: float = 95.0 / 255.0
    gradient: float = 0.25
    shadow_depth: float = 0.0
    shadow_sd_mm: float = 0.5
    shadow_offset_mm: float = 0.6
    blur_px: float = 1.0
    noise: float = 3.0 / 255.0


CLEAN = Light()
STANDARD = Light(shadow_depth=0.18)
HARD = Light(
    gradient=0.40, shadow_depth=0.35, shadow_sd_mm=0.2, shadow_offset_mm=0.35
)  # fmt: skip
LIGHTS = {"clean": CLEAN, "standard": STANDARD, "hard": HARD}
"""The three lights of the accuracy table: even, soft shadow, close hard shadow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What a synthetic frame shows, exactly.

    Parameters
    ----------
    centreline : Centreline
        The rod's axis in the specimen frame, in mm.
    points_px : ndarray, shape (n, 2)
        The same points in the picture.
    width_px, length_px, px_per_mm : float
        Width and length of the rod in the picture, and the scale.
    pose : Pose
        The specimen frame in the frame of `calibration`.
    calibration : Calibration
        The exact scale of the picture; its frame has its origin in the centre.
    """

    centreline: Centreline
    points_px: Array
    width_px: float
    length_px: float
    px_per_mm: float
    pose: Pose
    calibration: Calibration

    @property
    def clamp_px(self) -> tuple[float, float]:
        """Where the axis leaves the clamp, in pixels."""
        return float(self.points_px[0, 0]), float(self.points_px[0, 1])

    @property
    def tip_px(self) -> tuple[float, float]:
        """Middle of the end face, in pixels."""
        return float(self.points_px[-1, 0]), float(self.points_px[-1, 1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """A synthetic photograph and its truth.

    Parameters
    ----------
    name : str
        What it is called.
    image : ndarray, shape (height, width), uint8
        The photograph.
    truth : Truth
        What it shows.
    linear : ndarray, shape (height, width), float32
        The light that fell on the sensor.
    noise : float
        Standard deviation of the noise that the sensor added to it.
    """

    name: str
    image: NDArray[np.uint8]
    truth: Truth
    linear: NDArray[np.float32]
    noise: float

    def again(self, rng: np.random.Generator) -> Frame:
        """Return another photograph of the same scene: only its noise is new."""
        return replace(self, image=_recorded(self.linear, self.noise, rng))


def curve(
    kind: Kind, *, length_mm: float = 30.0, angle_deg: float = 0.0, points: int = 1201
) -> Centreline:
    """Return a test shape in the specimen frame.

    Parameters
    ----------
    kind : {"straight", "arc", "s", "graded"}
        ``arc`` has constant curvature; ``s`` bends by `angle_deg` and back again;
        ``graded`` has a bending moment falling to 0 at the tip over three sections of
        relative stiffness 2, 1.5 and 1, so its curvature jumps at the joints.
    length_mm : float
        Arc length, in mm.
    angle_deg : float
        Angle turned in all (at the middle for ``s``); + bends to the left.
    points : int
        Number of points.
    """
    length = positive(length_mm, "length_mm", "mm")
    s = np.linspace(0.0, length, points)
    u = s / length
    turn = np.radians(angle_deg)
    if kind == "straight":
        theta, kappa = np.zeros_like(s), np.zeros_like(s)
    elif kind == "arc":
        theta, kappa = turn * u, np.full_like(s, turn / length)
    elif kind == "s":
        theta = turn * np.sin(np.pi * u)
        kappa = turn * np.pi / length * np.cos(np.pi * u)
    elif kind == "graded":
        theta, kappa = _graded(u, turn, length)
    else:
        raise InputError(
            f"kind must be straight, arc, s or graded; instead received {kind!r}"
        )
    x, y = _integrate(np.cos(theta), s), _integrate(np.sin(theta), s)
    return Centreline(s_mm=s, x_mm=x, y_mm=y, theta_rad=theta, kappa_per_mm=kappa)


def _graded(u: Array, turn: float, length: float) -> tuple[Array, Array]:
    """Return theta and kappa of a moment 1 - u over stiffness 2, 1.5, 1."""
    stiffness = np.select([u < 1.0 / 3.0, u < 2.0 / 3.0], [2.0, 1.5], 1.0)
    kappa = (1.0 - u) / stiffness
    theta = np.zeros_like(u)
    for first, last, value in ((0.0, 1 / 3, 2.0), (1 / 3, 2 / 3, 1.5), (2 / 3, 1, 1.0)):
        inside = np.clip(u, first, last)
        theta += (inside - first - 0.5 * (inside**2 - first**2)) / value
    factor = turn / theta[-1]
    return theta * factor, kappa * factor / length


def _integrate(f: Array, s: Array) -> Array:
    """Return the running integral of f over the even grid s, to fourth order."""
    h = s[1] - s[0]
    padded = np.concatenate([[2 * f[0] - f[1]], f, [2 * f[-1] - f[-2]]])
    piece = h / 24.0 * (13.0 * (f[:-1] + f[1:]) - padded[:-3] - padded[3:])
    return np.concatenate([[0.0], np.cumsum(piece)])


def draw(
    shape: Centreline,
    rng: np.random.Generator,
    *,
    px_per_mm: float = 20.0,
    side_mm: float = 1.0,
    light: Light = STANDARD,
    size_px: tuple[int, int] = (1920, 1080),
    clamp_px: tuple[float, float] | None = None,
    angle_deg: float | None = None,
    clamp_height_mm: float = 8.0,
    name: str = "synthetic",
) -> Frame:
    """Draw one frame.

    Parameters
    ----------
    shape : Centreline
        The rod's axis in the specimen frame.
    rng : numpy.random.Generator
        Source of the noise and of the place, where none is given.
    px_per_mm, side_mm : float
        Scale, and width of the rod in mm.
    light : Light
        Levels, gradient, shadow, blur and noise.
    size_px : tuple of int
        Width and height of the picture.
    clamp_px : tuple of float, optional
        Where the rod leaves the clamp.
    angle_deg : float, optional
        Direction of the rod there, counter-clockwise from the right of the picture.
        Without place and direction, both are drawn at random so that the rod fits.
    clamp_height_mm : float
        Width of the clamp block across the rod; 0 draws no clamp.
    name : str
        Name of the frame.

    Raises
    ------
    InputError
        If no place was found where the rod fits into the picture.
    """
    width, height = size_px
    calibration = scale_calibration(
        mm_per_px=1.0 / positive(px_per_mm, "px_per_mm", "px/mm"),
        image_size_px=size_px,
        tilt_sd_deg=0.0,
        source="exact",
    )
    if clamp_px is None or angle_deg is None:
        pose = _place(shape, rng, calibration, margin_px=2.5 * side_mm * px_per_mm)
    else:
        (at,) = calibration.to_mm(np.array([clamp_px]))
        pose = Pose(x_mm=float(at[0]), y_mm=float(at[1]), angle_deg=angle_deg)
    points = calibration.to_px(pose.to_board(shape.points_mm))
    heading = shape.theta_rad + np.radians(pose.angle_deg)
    # In the picture y runs down: the left of the rod is at (-sin, -cos).
    normals = np.column_stack([-np.sin(heading), -np.cos(heading)])
    width_px = side_mm * px_per_mm
    # The rod goes on inside the clamp: else paper shines through where they meet.
    held = points[0] - width_px * np.array([np.cos(heading[0]), -np.sin(heading[0])])
    outline = strip(
        np.vstack([held[None], points]),
        np.vstack([normals[:1], normals]),
        width_px / 2.0,
    )
    rod = coverage(
        outline if clamp_height_mm > 0.0 else strip(points, normals, width_px / 2.0),
        width,
        height,
    )
    block = _clamp_block(points[0], heading[0], clamp_height_mm * px_per_mm, size_px)
    linear = _expose(rod, block, light, px_per_mm, rng)
    return Frame(
        name=name,
        image=_recorded(linear, light.noise, rng),
        linear=linear,
        noise=light.noise,
        truth=Truth(
            centreline=shape,
            points_px=points,
            width_px=width_px,
            length_px=shape.length_mm * px_per_mm,
            px_per_mm=px_per_mm,
            pose=replace(pose, angle_deg=(pose.angle_deg + 180.0) % 360.0 - 180.0),
            calibration=calibration,
        ),
    )


def _place(
    shape: Centreline, rng: np.random.Generator, calibration: Calibration,
    *, margin_px: float,
) -> Pose:  # fmt: skip
    size = np.array(calibration.image_size_px, dtype=np.float64)
    for _ in range(1000):
        pose = Pose(x_mm=0.0, y_mm=0.0, angle_deg=rng.uniform(-180.0, 180.0))
        # Some of the clamp must show: keep room for a point 5 mm inside it.
        with_clamp = np.concatenate([shape.points_mm, [[-5.0, 0.0]]])
        points = calibration.to_px(pose.to_board(with_clamp))
        low, high = points.min(axis=0), points.max(axis=0)
        room = size - 1.0 - 2.0 * margin_px - (high - low)
        if np.all(room > 0.0):
            shift = margin_px - low + rng.uniform(size=2) * room
            (at,) = calibration.to_mm(points[:1] + shift)
            return replace(pose, x_mm=float(at[0]), y_mm=float(at[1]))
    raise InputError(
        f"the rod must fit into {calibration.image_size_px} px; instead none of 1000 "
        "random places has room for it: make the picture larger or the scale smaller"
    )


def _clamp_block(
    clamp_px: Array, heading: float, across_px: float, size_px: tuple[int, int]
) -> NDArray[np.float32]:
    """Return the coverage of a block that ends at the clamp point."""
    width, height = size_px
    if across_px <= 0.0:
        return np.zeros((height, width), dtype=np.float32)
    along = np.array([np.cos(heading), -np.sin(heading)])
    left = np.array([-np.sin(heading), -np.cos(heading)]) * across_px / 2.0
    back = clamp_px - along * 2.0 * (width + height)
    corners = np.array([clamp_px + left, clamp_px - left, back - left, back + left])
    return coverage(corners, width, height)


def _expose(
    rod: NDArray[np.float32],
    block: NDArray[np.float32],
    light: Light,
    px_per_mm: float,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Return the light that falls on the sensor."""
    height, width = rod.shape
    paper = np.full(rod.shape, light.paper, dtype=np.float32)
    if light.shadow_depth > 0.0:
        shift = light.shadow_offset_mm * px_per_mm / np.sqrt(2.0)
        moved = cv2.warpAffine(
            rod, np.array([[1.0, 0.0, shift], [0.0, 1.0, shift]]), (width, height)
        )
        soft = cv2.GaussianBlur(moved, (0, 0), light.shadow_sd_mm * px_per_mm)
        paper *= 1.0 - light.shadow_depth * soft
    linear = paper + rod * (light.rod - paper)
    linear += block * (light.clamp - linear)
    direction = rng.uniform(0.0, 2.0 * np.pi)
    across = np.cos(direction) * np.linspace(-0.5, 0.5, width, dtype=np.float32)
    down = np.sin(direction) * np.linspace(-0.5, 0.5, height, dtype=np.float32)
    ramp = (across[None, :] + down[:, None]) / (
        abs(np.cos(direction)) + abs(np.sin(direction))
    )
    linear *= (1.0 + light.gradient * (ramp - 0.5)).astype(np.float32)
    if light.blur_px > 0.0:
        linear = np.asarray(cv2.GaussianBlur(linear, (0, 0), light.blur_px))
    return np.asarray(linear)


def _recorded(
    linear: NDArray[np.float32], noise: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Return what a camera writes: noise, the sRGB curve and 8 bits."""
    grain = rng.standard_normal(linear.shape, dtype=np.float32)
    return encode_srgb(linear + np.float32(noise) * grain)


SHAPES: tuple[tuple[str, Kind, float], ...] = (
    ("straight", "straight", 0.0),
    ("arc030", "arc", 30.0),
    ("arc090", "arc", -90.0),
    ("arc150", "arc", 150.0),
    ("arc250", "arc", 250.0),
    ("s", "s", 45.0),
    ("graded040", "graded", 40.0),
    ("graded090", "graded", -90.0),
    ("graded130", "graded", 130.0),
)
"""The nine shapes of the accuracy table: name, kind and angle in degrees."""


def frames(
    seed: int = 0,
    *,
    scales_px_per_mm: tuple[float, ...] = (20.0, 40.0),
    lights: tuple[str, ...] = ("clean", "standard", "hard"),
    side_mm: float = 1.0,
) -> Iterator[Frame]:
    """Yield the set of the accuracy table: nine shapes, three lights, two scales.

    Parameters
    ----------
    seed : int
        Same seed, same pictures.
    scales_px_per_mm : tuple of float
        Scales; from 30 px/mm on the pictures are 2600 x 1800 px, else 1920 x 1080.
    lights : tuple of str
        Names in `LIGHTS`.
    side_mm : float
        Width of the rod.
    """
    for scale in scales_px_per_mm:
        size = (2600, 1800) if scale >= 30.0 else (1920, 1080)
        for light in lights:
            for index, (name, kind, angle) in enumerate(SHAPES):
                rng = np.random.default_rng([seed, int(scale), len(light), index])
                yield draw(
                    curve(kind, angle_deg=angle),
                    rng,
                    px_per_mm=scale,
                    side_mm=side_mm,
                    light=LIGHTS[light],
                    size_px=size,
                    name=f"{name}_{light}_{scale:g}",
                )
