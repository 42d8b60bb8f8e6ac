"""Photographs to calibrated centrelines in mm.

`calibrate` turns photographs of a board into a `Calibration`; `extract` turns one
photograph into a `Measurement`, `extract_files` many into tables; `synthetic` and
`scene` draw photographs with exactly known truth.
"""

from __future__ import annotations

from .batch import BatchResult, Settings, extract_files, measure
from .board import Board
from .board_print import write_board
from .calibrate import calibrate, calibrate_known_length
from .calibration import Calibration, scale_calibration, specimen_to_px
from .extract import extract
from .measurement import Measurement, Pose
from .overlay import draw_overlay
from .photo import Photo, as_photo, read_photo
from .score import Score, score
from .tables import read_centrelines, read_frames

__all__ = [
    "BatchResult",
    "Board",
    "Calibration",
    "Measurement",
    "Photo",
    "Pose",
    "Score",
    "Settings",
    "as_photo",
    "calibrate",
    "calibrate_known_length",
    "draw_overlay",
    "extract",
    "extract_files",
    "measure",
    "read_centrelines",
    "read_frames",
    "read_photo",
    "scale_calibration",
    "score",
    "specimen_to_px",
    "write_board",
]
