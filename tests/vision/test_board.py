"""The printed board: true scale, the pattern that OpenCV finds, and refusals."""

from __future__ import annotations

import re
import struct
import zlib

import cv2
import numpy as np
import pytest

from magbend.core.errors import InputError, VisionError
from magbend.vision.camera.board import Board, find_corners
from magbend.vision.camera.board_print import write_board
from magbend.vision.picture.photo import as_photo
from magbend.vision.synthetic import render_board, scene_camera

DESIGNS = [
    Board(),
    Board(columns=5, rows=7, square_mm=6.0, marker_mm=4.0, dictionary="DICT_6X6_250"),
    Board(columns=6, rows=9, square_mm=4.0, marker_mm=3.0, dictionary="DICT_5X5_100"),
]


def rectangles(pdf: bytes) -> np.ndarray:
    """Return grey, x, y, width, height in mm of every filled rectangle of a PDF."""
    packed = re.search(rb"stream\n(.*?)\nendstream", pdf, re.DOTALL).group(1)
    text = zlib.decompress(packed).decode()
    found = re.findall(r"([01]) g\n([\d. ]+) re f", text)
    rows = [[float(grey), *map(float, box.split())] for grey, box in found]
    return np.array(rows) / [1, *[72 / 25.4] * 4]


@pytest.mark.parametrize("design", DESIGNS)
def test_our_drawing_is_the_board_that_opencv_draws(design):
    px = 30
    outlines, signs = design.black_polygons()
    theirs = np.asarray(
        design.charuco().generateImage((design.columns * px, design.rows * px))
    )
    ours = np.full(theirs.shape, 255, dtype=np.uint8)
    for outline, sign in zip(outlines, signs, strict=True):
        corners = np.round(outline / design.square_mm * px * [1, -1]).astype(int)
        (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
        ours[y0:y1, x0:x1] = 0 if sign > 0 else 255
    # Markers may be shifted by a pixel of rounding; nothing else may differ.
    inner = cv2.erode((ours != theirs).astype(np.uint8), np.ones((5, 5), np.uint8))
    assert not inner.any()


@pytest.mark.parametrize("design", DESIGNS)
def test_pdf_is_at_true_scale(tmp_path, design):
    write_board(design, tmp_path / "board.pdf")
    pdf = (tmp_path / "board.pdf").read_bytes()
    assert pdf.startswith(b"%PDF-1.4")
    boxes = rectangles(pdf)
    black = boxes[boxes[:, 0] == 0]
    squares = black[np.isclose(black[:, 3], design.square_mm, atol=1e-4)]
    assert len(squares) == (design.columns * design.rows + 1) // 2
    np.testing.assert_allclose(squares[:, 4], design.square_mm, atol=1e-4)
    corners = np.concatenate([squares[:, 1:3], squares[:, 1:3] + squares[:, 3:5]])
    np.testing.assert_allclose(
        np.ptp(corners, axis=0),
        [design.columns * design.square_mm, design.rows * design.square_mm],
        atol=1e-3,
    )
    media = re.search(rb"MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf)
    page = [float(side) * 25.4 / 72 for side in media.groups()]
    assert corners.min() > 5.0
    assert np.all(corners.max(axis=0) < np.array(page) - 5.0)


def test_pdf_cross_references_are_right(tmp_path):
    write_board(Board(), tmp_path / "board.pdf")
    pdf = (tmp_path / "board.pdf").read_bytes()
    start = int(re.search(rb"startxref\n(\d+)", pdf).group(1))
    assert pdf[start:].startswith(b"xref")
    places = re.findall(rb"(\d{10}) 00000 n", pdf)
    assert len(places) == 5
    for number, place in enumerate(places, start=1):
        assert pdf[int(place) :].startswith(f"{number} 0 obj".encode())


def test_png_knows_its_resolution_and_is_found(tmp_path):
    path = tmp_path / "board.png"
    write_board(Board(), path, dpi=300)
    data = path.read_bytes()
    at = data.index(b"pHYs")
    assert struct.unpack(">IIB", data[at + 4 : at + 13]) == (11811, 11811, 1)
    (crc,) = struct.unpack(">I", data[at + 13 : at + 17])
    assert crc == zlib.crc32(data[at : at + 13])
    ids, points = find_corners(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), Board())
    assert len(ids) == 24
    px_per_mm = 300 / 25.4
    first = points[ids == 0][0]
    across = points[ids == 5][0] - first
    assert np.hypot(*across) == pytest.approx(50.0 * px_per_mm, abs=0.3)


@pytest.mark.parametrize("design", DESIGNS)
def test_photographed_board_is_found_where_it_is(design):
    camera = scene_camera(tilt_deg=8.0, turn_deg=40.0, focal_px=5500.0)
    picture = render_board(design, camera, np.random.default_rng(1))
    ids, points = find_corners(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), design)
    assert len(ids) >= 0.7 * design.inner[0] * design.inner[1]
    error = points - camera.to_px(design.corners_mm(ids))
    assert np.sqrt(np.mean(error**2)) < 0.06


def test_chessboard_is_numbered_without_mirroring():
    board = Board(kind="chessboard", columns=6, rows=4, square_mm=9.0)
    camera = scene_camera(turn_deg=180.0, tilt_deg=4.0)
    # A plain chessboard of 7 x 5 squares: a ChArUco board's squares without markers.
    plain = Board(columns=7, rows=5, square_mm=9.0, marker_mm=0.01)
    picture = render_board(plain, camera, np.random.default_rng(0))
    photo = as_photo(picture)
    assert photo.size_px == (1600, 1200)
    ids, points = find_corners(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), board)
    assert len(ids) == 24
    order = np.argsort(ids)
    along = points[order][5] - points[order][0]
    down = points[order][18] - points[order][0]
    assert along[0] * down[1] - along[1] * down[0] > 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"columns": 2}, "at least 3 x 3"),
        ({"marker_mm": 10.0}, "below square_mm"),
        ({"square_mm": -1.0}, "above zero"),
        ({"dictionary": "DICT_9X9"}, "DICT_4X4_50"),
        ({"dictionary": "CharucoBoard"}, "DICT_4X4_50"),
        ({"columns": 15, "rows": 15}, "holds 50"),
        ({"print_scale": 10.0}, "print_scale"),
        ({"square_mm": float("nan")}, "finite"),
    ],
)
def test_impossible_boards_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        Board(**change)


@pytest.mark.parametrize(
    ("design", "name", "words"),
    [
        (Board(rows=4), "b.pdf", "odd number of rows"),
        (Board(), "b.jpg", ".pdf or .png"),
        (Board(kind="chessboard"), "b.pdf", "ChArUco"),
        (Board(square_mm=400.0), "b.pdf", "1500 mm"),
    ],
)
def test_boards_that_should_not_be_printed_are_refused(tmp_path, design, name, words):
    with pytest.raises(InputError, match=words):
        write_board(design, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_noise_is_no_board():
    noise = np.random.default_rng(0).integers(0, 255, (300, 400), dtype=np.uint8)
    with pytest.raises(VisionError, match="no board"):
        find_corners(noise, Board())
