"""The board to print and to find: ChArUco, or a plain chessboard.

Board frame: origin at the outer corner of the first square, x along the first row, y up
the board (against the rows), mm; see `calibration`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.checks import positive
from ...core.errors import InputError, VisionError

Array = NDArray[np.float64]

STRANGE_MARKERS = 2
"""So many markers of other numbers may be misread from print and dirt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A flat board with corners at known places.

    Parameters
    ----------
    kind : {"charuco", "chessboard"}
        A chessboard has no markers, so its two ends cannot be told apart.
    columns, rows : int
        Squares of a ChArUco board; inner corners of a chessboard (as OpenCV counts).
    square_mm, marker_mm : float
        Nominal sides of a square and of a marker.
    dictionary : str
        OpenCV's name of the markers' dictionary.
    print_scale : float
        Measured length over nominal length of the print; printers are off by 0.1-0.5 %.
    legacy : bool
        Whether the board follows the pattern of OpenCV before 4.6 (matters only for an
        even number of rows).

    Raises
    ------
    InputError
        If a number cannot be, or the dictionary is unknown or too small.
    """

    kind: Literal["charuco", "chessboard"] = "charuco"
    columns: int = 7
    rows: int = 5
    square_mm: float = 10.0
    marker_mm: float = 7.5
    dictionary: str = "DICT_4X4_50"
    print_scale: float = 1.0
    legacy: bool = False

    def __post_init__(self) -> None:
        if self.columns < 3 or self.rows < 3:
            raise InputError(
                "the board must have at least 3 x 3 squares; "
                f"instead received {self.columns} x {self.rows}"
            )
        positive(self.square_mm, "square_mm", "mm")
        positive(self.print_scale, "print_scale")
        if not 0.9 < self.print_scale < 1.1:
            raise InputError(
                "print_scale must be measured over nominal length, from 0.9 to 1.1; "
                f"instead received {self.print_scale:g}"
            )
        if self.kind == "charuco":
            positive(self.marker_mm, "marker_mm", "mm")
            if self.marker_mm >= self.square_mm:
                raise InputError(
                    f"marker_mm must be below square_mm ({self.square_mm:g} mm); "
                    f"instead received {self.marker_mm:g} mm"
                )
            self._check_dictionary()

    def _check_dictionary(self) -> None:
        held = len(dictionary_of(self.dictionary).bytesList)
        if held < self.markers:
            raise InputError(
                f"dictionary must hold the {self.markers} markers of a board of "
                f"{self.columns} x {self.rows} squares; instead {self.dictionary} "
                f"holds {held}"
            )

    @property
    def size_mm(self) -> tuple[float, float]:
        """Nominal width and height of the squares, in mm."""
        extra = 0 if self.kind == "charuco" else 1
        return (
            (self.columns + extra) * self.square_mm,
            (self.rows + extra) * self.square_mm,
        )

    @property
    def markers(self) -> int:
        """Number of markers of a ChArUco board."""
        return self.columns * self.rows // 2

    @property
    def inner(self) -> tuple[int, int]:
        """Number of inner corners along a row and along a column."""
        cut = 1 if self.kind == "charuco" else 0
        return self.columns - cut, self.rows - cut

    def describe(self) -> str:
        """Return the board as a sentence for people."""
        if self.kind == "chessboard":
            what = f"chessboard, {self.columns} x {self.rows} inner corners"
        else:
            what = (
                f"ChArUco, {self.columns} x {self.rows} squares, "
                f"markers {self.marker_mm:g} mm of {self.dictionary}"
            )
        return (
            f"{what}, squares {self.square_mm:g} mm, "
            f"printed at {self.print_scale:.5g} of its size"
        )

    def corners_mm(self, ids: NDArray[np.int64]) -> Array:
        """Return inner corners by number, shape (n, 2), in mm in the board frame."""
        across, _ = self.inner
        row, column = np.divmod(np.asarray(ids), across)
        square = self.square_mm * self.print_scale
        first = 1 if self.kind == "charuco" else 0
        return np.column_stack([(column + first) * square, -(row + first) * square])

    def charuco(self) -> Any:
        """Return OpenCV's own object of the board."""
        board = cv2.aruco.CharucoBoard(
            (self.columns, self.rows),
            float(self.square_mm),
            float(self.marker_mm),
            dictionary_of(self.dictionary),
        )
        board.setLegacyPattern(self.legacy)
        return board

    def black_polygons(self) -> tuple[list[Array], list[int]]:
        """Return what is printed black, in mm in the board frame.

        Returns
        -------
        list of ndarray, shape (4, 2)
            Squares and markers (sign +1), and the white cells in the markers (-1).
        list of int
            The signs.
        """
        outlines: list[Array] = []
        signs: list[int] = []
        square, marker = self.square_mm, self.marker_mm
        number = 0
        # OpenCV starts with black, except for even rows of its old pattern.
        start = 1 if self.legacy and self.rows % 2 == 0 else 0
        for row in range(self.rows):
            for column in range(self.columns):
                x, y = column * square, row * square
                if (row + column + start) % 2 == 0:
                    outlines.append(_box(x, y, square))
                    signs.append(1)
                    continue
                edge = (square - marker) / 2.0
                inked = marker_polygons(
                    self.dictionary, number, (x + edge, y + edge), marker
                )
                number += 1
                outlines += inked[0]
                signs += inked[1]
        scaled = [outline * self.print_scale for outline in outlines]
        return scaled, signs


def marker_polygons(
    dictionary: str, number: int, left_top_mm: tuple[float, float], side_mm: float
) -> tuple[list[Array], list[int]]:
    """Return what is black of a marker, as `Board.black_polygons` does.

    Parameters
    ----------
    dictionary, number : str, int
        Which marker of which dictionary of OpenCV.
    left_top_mm : tuple of float
        Its left top corner, y running down.
    side_mm : float
        Its side with the black frame.
    """
    left, top = left_top_mm
    bits = _bits(dictionary_of(dictionary), number)
    cell = side_mm / (len(bits) + 2)
    white = [
        _box(left + (j + 1) * cell, top + (i + 1) * cell, cell)
        for i, j in np.argwhere(bits)
    ]
    return [_box(left, top, side_mm), *white], [1] + [-1] * len(white)


def _box(left: float, top: float, side: float) -> Array:
    """Return a square of the board frame from its top left corner, y running down."""
    x = np.array([left, left + side, left + side, left])
    y = -np.array([top, top, top + side, top + side])
    return np.column_stack([x, y])


def dictionary_of(name: str) -> Any:
    """Return OpenCV's dictionary of a name."""
    number = getattr(cv2.aruco, name, None)
    if not name.startswith("DICT_") or not isinstance(number, int):
        raise InputError(
            "dictionary must be one of OpenCV's, such as DICT_4X4_50 or DICT_6X6_250; "
            f"instead received {name!r}"
        )
    return cv2.aruco.getPredefinedDictionary(number)


def _bits(dictionary: Any, number: int) -> NDArray[np.uint8]:
    """Return a marker's bits, 1 is white, without its black frame."""
    size = int(dictionary.markerSize)
    picture = cv2.aruco.generateImageMarker(dictionary, number, size + 2)
    return np.asarray(np.asarray(picture)[1:-1, 1:-1] > 127, dtype=np.uint8)


def find_corners(
    grey: NDArray[np.uint8], board: Board
) -> tuple[NDArray[np.int64], Array]:
    """Find the board's inner corners in a photograph.

    Parameters
    ----------
    grey : ndarray of uint8, shape (h, w)
        The photograph.
    board : Board
        Which board to look for.

    Returns
    -------
    ids : ndarray, shape (n,)
        Numbers of the corners found, for `Board.corners_mm`.
    points_px : ndarray, shape (n, 2)
        Where they are, in pixels.

    Raises
    ------
    VisionError
        If fewer than six corners are found, or markers of another board.
    """
    if board.kind == "chessboard":
        ids, points = _find_chessboard(grey, board)
    else:
        ids, points = _find_charuco(grey, board)
    across, _ = board.inner
    if len(ids) < 6 or len(set(ids // across)) < 2 or len(set(ids % across)) < 2:
        raise VisionError(
            f"no board was found ({len(ids)} corners of {across * board.inner[1]}): "
            f"the photograph must show the {board.describe()}"
        )
    return ids, points


def _find_charuco(
    grey: NDArray[np.uint8], board: Board
) -> tuple[NDArray[np.int64], Array]:
    detector = cv2.aruco.CharucoDetector(board.charuco())
    corners, ids, _, markers = detector.detectBoard(grey)
    strange = np.ravel([] if markers is None else markers) >= board.markers
    if np.count_nonzero(strange) > STRANGE_MARKERS:
        raise VisionError(
            f"{np.count_nonzero(strange)} markers are not on a board of "
            f"{board.columns} x {board.rows} squares: say which board was photographed"
        )
    if ids is None or corners is None:
        return np.empty(0, dtype=np.int64), np.empty((0, 2))
    points = np.asarray(corners, dtype=np.float64).reshape(-1, 2)
    numbers = np.asarray(ids, dtype=np.int64).reshape(-1)
    return numbers, _refined(grey, board, numbers, points)


def _refined(
    grey: NDArray[np.uint8], board: Board, ids: NDArray[np.int64], points: Array
) -> Array:
    """Return the corners once more to sub-pixel, the same in every OpenCV.

    OpenCV 4.10 gives ChArUco corners half a pixel too far right and down; newer ones
    do not. The window stays clear of the markers.
    """
    if len(ids) < 6:
        return points
    design = np.column_stack([board.corners_mm(ids), np.ones(len(ids))])
    solution, *_ = np.linalg.lstsq(design, points, rcond=None)
    px_per_mm = float(np.sqrt(abs(np.linalg.det(solution[:2]))))
    clear = 0.3 * (board.square_mm - board.marker_mm) * px_per_mm
    half = int(np.clip(clear, 3, 10))
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
    start = np.ascontiguousarray(points.reshape(-1, 1, 2), dtype=np.float32)
    found = cv2.cornerSubPix(grey, start, (half, half), (-1, -1), criteria)
    moved = np.asarray(found, dtype=np.float64).reshape(-1, 2)
    lost = np.hypot(*(moved - points).T) > 2.0
    return np.where(lost[:, None], points, moved)


def _find_chessboard(
    grey: NDArray[np.uint8], board: Board
) -> tuple[NDArray[np.int64], Array]:
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(grey, board.inner, flags=flags)
    if not found:
        return np.empty(0, dtype=np.int64), np.empty((0, 2))
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
    corners = cv2.cornerSubPix(grey, corners, (5, 5), (-1, -1), criteria)
    points = np.asarray(corners, dtype=np.float64).reshape(-1, 2)
    return _upright(points, board), points


def _upright(points: Array, board: Board) -> NDArray[np.int64]:
    """Return the numbers of the corners for a board that is not mirrored."""
    across, down = board.inner
    ids = np.arange(across * down)
    along = points[across - 1] - points[0]
    downward = points[-across] - points[0]
    if along[0] * downward[1] - along[1] * downward[0] > 0.0:
        return ids
    row, column = np.divmod(ids, across)
    return np.asarray(row * across + (across - 1 - column))
