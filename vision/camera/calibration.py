"""From pixels to millimetres and back, at any height above the board's plane.

Board frame: origin at the outer corner of the board's first square, x to the right
along the first row, y up the board (so y is to the left of x seen by the camera), z
toward the camera; the printed face is z = 0. It is the frame of OpenCV's boards turned
by half a turn about x, since there y runs down and z into the board.

The camera is a pinhole with the radial and tangential distortion of Brown (1966) as
OpenCV writes it. Points are undistorted, whole images never, so nothing is resampled.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...core.checks import finite, positive
from ...core.errors import InputError, VisionError
from ..measurement import Pose
from .clamp_tag import ClampTag
from .projection import Camera, points_to_picture, points_to_plane

Array = NDArray[np.float64]

STRAIGHT_SD_DEG = 0.3
"""How squarely a camera looks down on a plane of which no board was seen: it is set up
by eye, or with a level."""
NO_PARALLAX = "unknown: no correction for height"
"""Source of the camera height where none is known; the view counts as parallel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What one photograph of the board gave: its name, RMS, and whether it was used."""

    name: str
    rms_px: float
    corners: int
    used: bool
    why_not: str = ""


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A camera and the plane it looks at.

    Parameters
    ----------
    image_size_px : tuple of int
        Width and height of the photographs it is for.
    focal_px, centre_px : tuple of float
        Focal lengths and principal point in pixels.
    distortion : tuple of float
        k1, k2, p1, p2, k3 as OpenCV defines them.
    rotation : ndarray, shape (3, 3)
        From the board frame to the camera frame (x right, y down, z forward).
    translation_mm : ndarray, shape (3,)
        Origin of the board frame in the camera frame, in mm.
    camera_height_sd_mm : float
        Standard deviation of the camera's height above the board; infinite where the
        height is unknown.
    camera_height_source : str
        Where the height comes from.
    scale_relative_sd : float
        Relative standard deviation of mm per pixel in the board's plane, from the
        corners alone; the print scale comes on top.
    rms_px : float
        RMS distance of the corners of the plane photograph from the model.
    tilt_sd_deg : float
        Standard deviation of the angle at which the plane is seen: what stands above it
        leans by so much to any side. 0 where a file of before does not tell.
    rod_height_mm : float or None
        Height of the rod's axis above the board's plane, taken when none is given; None
        where nobody told it.
    print_scale : float
        Measured over nominal length of the printed board, as it was taken into account.
    board, views : str, tuple of View
        The board as a sentence, and each photograph with its verdict.
    orientation : int or None
        EXIF's 1 to 8 of the plane photograph (see `oriented`); None where unknown.
    clamp_tag : ClampTag or None
        A tag that is glued on the clamp.
    """

    image_size_px: tuple[int, int]
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, float, float, float, float]
    rotation: Array
    translation_mm: Array
    camera_height_sd_mm: float
    camera_height_source: str
    scale_relative_sd: float
    rms_px: float
    tilt_sd_deg: float = 0.0
    rod_height_mm: float | None = None
    print_scale: float = 1.0
    board: str = ""
    views: tuple[View, ...] = ()
    orientation: int | None = None
    clamp_tag: ClampTag | None = None

    def __post_init__(self) -> None:
        for name, shape in (("rotation", (3, 3)), ("translation_mm", (3,))):
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise InputError(
                    f"calibration {name} must be {shape} finite numbers; "
                    f"instead received shape {value.shape}"
                )
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        error = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if error > 1e-6 or np.linalg.det(self.rotation) < 0.0:
            raise InputError(
                "calibration rotation must be a rotation matrix; instead its product "
                f"with its transpose differs from the unit matrix by {error:.2g}"
            )
        if self.rod_height_mm is None:
            return
        height = finite(self.rod_height_mm, "rod_height_mm", "mm")
        if height >= self.camera_height_mm:
            raise InputError(
                "rod_height_mm must be less than the height of the camera above the "
                f"plane, {self.camera_height_mm:g} mm; instead received {height:g} mm"
            )

    @property
    def is_scale_alone(self) -> bool:
        """Whether nothing but a scale is known: no lens, no tilt, no height."""
        return self.camera_height_source == NO_PARALLAX

    @cached_property
    def camera(self) -> Camera:
        """The numbers that kernels take."""
        return Camera(
            np.array([*self.focal_px, *self.centre_px, *self.distortion], np.float64),
            np.array(self.rotation, order="C"),
            np.array(self.translation_mm),
        )

    @property
    def camera_mm(self) -> Array:
        """Position of the camera in the board frame, shape (3,), in mm."""
        return np.asarray(-self.rotation.T @ self.translation_mm)

    @property
    def camera_height_mm(self) -> float:
        """Height of the camera above the board's plane, in mm."""
        return float(self.camera_mm[2])

    @property
    def tilt_deg(self) -> float:
        """Angle between the camera's axis and the board's normal, in degrees."""
        return float(np.degrees(np.arccos(np.clip(-self.rotation[2, 2], -1.0, 1.0))))

    def to_mm(self, points_px: Array, *, height_mm: float = 0.0) -> Array:
        """Return where pixels lie in the plane `height_mm` above the board.

        Parameters
        ----------
        points_px : ndarray, shape (n, 2)
            x (right) and y (down) in pixels.
        height_mm : float
            Height of the plane above the board, in mm.

        Returns
        -------
        ndarray, shape (n, 2)
            Board frame, in mm; NaN where the ray does not meet the plane.
        """
        points = np.array(points_px, dtype=np.float64, order="C").reshape(-1, 2)
        return np.asarray(points_to_plane(self.camera, points, float(height_mm)))

    def to_px(self, points_mm: Array, *, height_mm: float = 0.0) -> Array:
        """Return the pixels of points `height_mm` above the board: undo `to_mm`.

        Parameters
        ----------
        points_mm : ndarray, shape (n, 2)
            Board frame, in mm.
        height_mm : float
            Their height above the board, in mm.

        Returns
        -------
        ndarray, shape (n, 2)
            In pixels.
        """
        points = np.array(points_mm, dtype=np.float64, order="C").reshape(-1, 2)
        return np.asarray(points_to_picture(self.camera, points, float(height_mm)))

    def mm_per_px(self, point_px: tuple[float, float], *, height_mm: float) -> float:
        """Return the local scale at a pixel: the root of the area of a pixel, mm."""
        x, y = point_px
        square = np.array([[x, y], [x + 1.0, y], [x, y + 1.0]])
        corner, right, down = self.to_mm(square, height_mm=height_mm)
        (a, b), (c, d) = right - corner, down - corner
        return float(np.sqrt(abs(a * d - b * c)))

    def check_size(self, width_px: int, height_px: int) -> None:
        """Refuse a photograph of another size than the calibration is for.

        Raises
        ------
        VisionError
            If the sizes differ.
        """
        if (width_px, height_px) != tuple(self.image_size_px):
            width, height = self.image_size_px
            raise VisionError(
                f"the calibration is for photographs of {width} x {height} px; instead "
                f"received {width_px} x {height_px} px: take the file as its camera "
                "wrote it, not turned or scaled by a program, or calibrate at its size"
            )


def scale_calibration(
    *,
    mm_per_px: float,
    image_size_px: tuple[int, int],
    camera_height_mm: float | None = None,
    scale_relative_sd: float = float("nan"),
    rod_height_mm: float | None = None,
    tilt_sd_deg: float = STRAIGHT_SD_DEG,
    source: str = "a scale given by hand",
) -> Calibration:
    """Return a calibration from nothing but a scale: no tilt, no lens, no board.

    Parameters
    ----------
    mm_per_px : float
        Millimetres per pixel in the measuring plane.
    image_size_px : tuple of int
        Width and height of the photographs.
    camera_height_mm : float, optional
        Height of the camera above that plane; without it height is not corrected.
    scale_relative_sd : float
        Relative standard deviation of the scale.
    rod_height_mm : float, optional
        Height of the rod's axis above that plane.
    tilt_sd_deg : float
        How squarely the camera looks down on it, as a standard deviation.
    source : str
        Where the scale comes from, in words.

    Notes
    -----
    The frame's origin is the centre of the picture, x right, y up.
    """
    positive(mm_per_px, "mm_per_px", "mm/px")
    if camera_height_mm is not None:
        positive(camera_height_mm, "camera_height_mm", "mm")
    width, height = image_size_px
    centre = ((width - 1) / 2.0, (height - 1) / 2.0)
    far = camera_height_mm is None
    distance_mm = 1e9 if camera_height_mm is None else camera_height_mm
    focal = distance_mm / mm_per_px
    return Calibration(
        image_size_px=image_size_px,
        focal_px=(focal, focal),
        centre_px=centre,
        distortion=(0.0, 0.0, 0.0, 0.0, 0.0),
        rotation=np.diag([1.0, -1.0, -1.0]),
        translation_mm=np.array([0.0, 0.0, distance_mm]),
        camera_height_sd_mm=float("inf") if far else 0.05 * distance_mm,
        camera_height_source=NO_PARALLAX if far else "given",
        scale_relative_sd=scale_relative_sd,
        rms_px=float("nan"),
        tilt_sd_deg=tilt_sd_deg,
        rod_height_mm=rod_height_mm,
        board=source,
    )


def specimen_to_px(calibration: Calibration, pose: Pose, xy_mm: Array) -> Array:
    """Return where points of the specimen frame lie in the photograph.

    Parameters
    ----------
    calibration : Calibration
        Of the camera that took the photograph.
    pose : Pose
        Where the specimen frame lies in the board frame.
    xy_mm : ndarray, shape (n, 2)
        Points on the rod's axis in the specimen frame, in mm.

    Returns
    -------
    ndarray, shape (n, 2)
        In pixels.
    """
    return calibration.to_px(pose.to_board(xy_mm), height_mm=pose.height_mm)
