"""A printed tag on the clamp, and where the rod's root lies in its frame.

Tag frame: origin in its middle, x toward the edge that is printed uppermost, y to the
left of x, mm. A tag is glued anywhere on the clamp, in any direction; where the root
lies is measured once, from photographs (`batch.tag_place`).
"""

from __future__ import annotations

from dataclasses import dataclass

from ...core.checks import finite, positive
from ...core.errors import InputError
from .board import Board, dictionary_of

SIDE_MM = 6.0
"""Side of a tag, where none is given: a cell is then a millimetre wide."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampTag:
    """A marker that is glued on the clamp.

    Parameters
    ----------
    dictionary, number : str, int
        Which marker of which dictionary of OpenCV.
    side_mm : float
        Its side, as it is on the clamp.
    height_mm : float
        Height of its face above the board's plane.
    root_x_mm, root_y_mm : float
        Where the rod leaves the clamp, in the tag's frame.
    angle_deg : float
        Direction of the rod there, counter-clockwise from the tag's x axis.
    place_sd_mm, angle_sd_deg : float
        Standard deviations of the root's place along the rod, and of the direction.
    board_angle_deg : float or None
        Direction of the tag's x axis in the board frame, when all that was measured:
        a clamp that lies turned against it since, or the camera, was moved.

    Raises
    ------
    InputError
        If a number cannot be, or the dictionary has no such marker.
    """

    dictionary: str = "DICT_4X4_50"
    number: int = 49
    side_mm: float = SIDE_MM
    height_mm: float = 0.0
    root_x_mm: float = 0.0
    root_y_mm: float = 0.0
    angle_deg: float = 0.0
    place_sd_mm: float = 0.0
    angle_sd_deg: float = 0.0
    board_angle_deg: float | None = None

    def __post_init__(self) -> None:
        positive(self.side_mm, "side of the tag", "mm")
        for name in ("height_mm", "root_x_mm", "root_y_mm", "angle_deg"):
            finite(getattr(self, name), f"{name} of the tag")
        held = len(dictionary_of(self.dictionary).bytesList)
        if not 0 <= self.number < held:
            raise InputError(
                f"number of the tag must be from 0 to {held - 1}, the markers of "
                f"{self.dictionary}; instead received {self.number}"
            )


def tag_number(board: Board) -> int:
    """Return the number of the tag that goes with a board: the dictionary's last.

    Raises
    ------
    InputError
        If the board uses that one itself.
    """
    last = len(dictionary_of(board.dictionary).bytesList) - 1
    if board.markers > last:
        raise InputError(
            f"a tag needs a marker of its own, and the board of {board.columns} x "
            f"{board.rows} squares uses all {last + 1} of {board.dictionary}: take a "
            "larger dictionary, such as DICT_4X4_100"
        )
    return last
