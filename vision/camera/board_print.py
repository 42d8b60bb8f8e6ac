"""The board on paper: a PDF at true scale, or a PNG that knows its resolution."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.files import write_bytes
from ..picture.raster import coverage_of
from .board import Board

Array = NDArray[np.float64]

MARGIN_MM = 12.0
A4_MM = (297.0, 210.0)
_POINT_PER_MM = 72.0 / 25.4
_NOTE_MM = 16.0  # room below the board for the control line and the caption


def write_board(board: Board, path: Path, *, dpi: int = 600) -> None:
    """Write the board to print: ``.pdf`` (true scale, vector) or ``.png``.

    Parameters
    ----------
    board : Board
        A ChArUco board with an odd number of rows.
    path : Path
        The file; its suffix says which kind.
    dpi : int
        Resolution of a PNG.

    Raises
    ------
    InputError
        If the suffix is neither, the board has an even number of rows (programs read
        those in two ways, shifted by a square), or is no ChArUco board.
    """
    if board.kind != "charuco":
        raise InputError("only ChArUco boards can be written; received a chessboard")
    if board.rows % 2 == 0:
        raise InputError(
            "the board must have an odd number of rows, because programs read even "
            f"ones in two ways; instead received {board.rows}: add or drop a row"
        )
    if board.columns * board.square_mm > 1500 or board.rows * board.square_mm > 1500:
        width, height = board.size_mm
        raise InputError(
            f"the board must be at most 1500 mm wide and high; instead received "
            f"{width:g} x {height:g} mm"
        )
    suffix = path.suffix.lower()
    if suffix == ".pdf":
        write_bytes(path, _pdf(board))
    elif suffix == ".png":
        if not 72 <= dpi <= 1200:
            raise InputError(f"dpi must be from 72 to 1200; instead received {dpi}")
        write_bytes(path, _png(board, dpi))
    else:
        raise InputError(
            f"{path}: a board is written as .pdf or .png; instead received {suffix!r}"
        )


def _page_mm(board: Board) -> tuple[float, float]:
    """Return the page: A4 across, or as large as the board needs."""
    width, height = board.size_mm
    needed = (width + 2 * MARGIN_MM, height + 2 * MARGIN_MM + _NOTE_MM)
    if needed[0] <= A4_MM[0] and needed[1] <= A4_MM[1]:
        return A4_MM
    return needed


def _pdf(board: Board) -> bytes:
    """Return a one-page PDF: filled rectangles in points, y up."""
    page_width, page_height = _page_mm(board)
    width, height = board.size_mm
    left = (page_width - width) / 2.0
    top = page_height - (page_height - _NOTE_MM - height) / 2.0
    lines = []
    outlines, signs = board.black_polygons()
    for outline, sign in zip(outlines, signs, strict=True):
        corner = outline.min(axis=0) / board.print_scale + (left, top)
        side = np.ptp(outline[:, 0]) / board.print_scale
        box = np.array([*corner, side, side]) * _POINT_PER_MM
        lines.append(f"{0 if sign > 0 else 1} g")
        lines.append(" ".join(f"{value:.5f}" for value in box) + " re f")
    y = (top - height - 9.0) * _POINT_PER_MM
    x = left * _POINT_PER_MM
    control_mm = 50.0 if width >= 50.0 else 10.0
    reach = control_mm * _POINT_PER_MM
    lines += ["0 g 0.4 w", f"{x:.5f} {y:.5f} m {x + reach:.5f} {y:.5f} l S"]
    for end in (x, x + reach):
        lines.append(f"{end:.5f} {y - 4:.5f} m {end:.5f} {y + 4:.5f} l S")
    note = (
        f"{control_mm:g} mm. Print at 100 %, measure the board, and give measured over "
        "nominal length as --print-scale."
    )
    for row, text in enumerate((note, board.describe().split(", printed")[0])):
        place = f"{x + (reach + 6 if row == 0 else 0):.3f} {y - 2 - 12 * row:.3f}"
        lines.append(f"BT /F1 8 Tf {place} Td ({text}) Tj ET")
    return _pdf_file("\n".join(lines).encode("ascii"), page_width, page_height)


def _pdf_file(content: bytes, width_mm: float, height_mm: float) -> bytes:
    """Wrap a content stream as a file (ISO 32000: objects, cross references)."""
    box = f"[0 0 {width_mm * _POINT_PER_MM:.5f} {height_mm * _POINT_PER_MM:.5f}]"
    packed = zlib.compress(content, 9)
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R "
        b"/ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R "
        "/Resources << /Font << /F1 5 0 R >> >> >>".encode(),
        f"<< /Length {len(packed)} /Filter /FlateDecode >>\nstream\n".encode()
        + packed
        + b"\nendstream",
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    data = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n"
    places = []
    for number, body in enumerate(objects, start=1):
        places.append(len(data))
        data += f"{number} 0 obj\n".encode() + body + b"\nendobj\n"
    start = len(data)
    data += f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n".encode()
    data += b"".join(f"{place:010d} 00000 n \n".encode() for place in places)
    data += f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\n".encode()
    return data + f"startxref\n{start}\n%%EOF\n".encode()


def _png(board: Board, dpi: int) -> bytes:
    """Return a grey PNG with its resolution inside (the pHYs chunk)."""
    px_per_mm = dpi / 25.4
    margin = round(MARGIN_MM * px_per_mm)
    width, height = (round(side * px_per_mm) + 2 * margin for side in board.size_mm)
    outlines, signs = board.black_polygons()
    pixels = [
        outline / board.print_scale * (px_per_mm, -px_per_mm) + (margin - 0.5)
        for outline in outlines
    ]
    ink = coverage_of(pixels, signs, width, height)
    grey = np.round(255.0 * (1.0 - ink)).astype(np.uint8)
    _, encoded = cv2.imencode(".png", grey)
    data = bytes(np.asarray(encoded).tobytes())
    per_metre = round(dpi / 0.0254)
    body = b"pHYs" + struct.pack(">IIB", per_metre, per_metre, 1)
    chunk = (
        struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    )
    after_header = 8 + 25  # signature and IHDR
    return data[:after_header] + chunk + data[after_header:]
