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
from .board import Board, marker_polygons
from .clamp_tag import tag_number

Array = NDArray[np.float64]

MARGIN_MM = 12.0
A4_MM = (297.0, 210.0)
_POINT_PER_MM = 72.0 / 25.4
_NOTE_MM = 16.0  # room below the board for the control line and the caption
_TAG_GAP_MM = 15.0  # between the board and the tag


def write_board(
    board: Board, path: Path, *, dpi: int = 600, tag_mm: float | None = None
) -> None:
    """Write the board to print: ``.pdf`` (true scale, vector) or ``.png``.

    Parameters
    ----------
    board : Board
        A ChArUco board with an odd number of rows.
    path : Path
        The file; its suffix says which kind.
    dpi : int
        Resolution of a PNG.
    tag_mm : float, optional
        Side of a tag for the clamp (`ClampTag`), printed beside the board.

    Raises
    ------
    InputError
        If the suffix is neither, the board has an even number of rows (programs read
        those in two ways, shifted by a square), or is no ChArUco board.
    """
    if tag_mm is not None and not 2.0 <= tag_mm <= 100.0:
        raise InputError(
            f"the tag must be from 2 to 100 mm wide; instead received {tag_mm:g} mm"
        )
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
        write_bytes(path, _pdf(board, tag_mm))
    elif suffix == ".png":
        if not 72 <= dpi <= 1200:
            raise InputError(f"dpi must be from 72 to 1200; instead received {dpi}")
        write_bytes(path, _png(board, dpi, tag_mm))
    else:
        raise InputError(
            f"{path}: a board is written as .pdf or .png; instead received {suffix!r}"
        )


def _inked(
    board: Board, tag_mm: float | None
) -> tuple[list[Array], list[int], tuple[float, float]]:
    """Return what is printed black at nominal size, its signs, and width and height.

    The board's left top corner is the origin, y up; the tag stands right of it.
    """
    outlines, signs = board.black_polygons()
    outlines = [outline / board.print_scale for outline in outlines]
    width, height = board.size_mm
    if tag_mm is None:
        return outlines, signs, (width, height)
    margin = tag_mm / 6.0
    left = width + _TAG_GAP_MM + margin
    tag, more = marker_polygons(
        board.dictionary, tag_number(board), (left, margin), tag_mm
    )
    reach = left + tag_mm + margin
    return outlines + tag, signs + more, (reach, max(height, tag_mm + 2.0 * margin))


def _page_mm(width: float, height: float) -> tuple[float, float]:
    """Return the page: A4 across, or as large as the print needs."""
    needed = (width + 2 * MARGIN_MM, height + 2 * MARGIN_MM + _NOTE_MM)
    if needed[0] <= A4_MM[0] and needed[1] <= A4_MM[1]:
        return A4_MM
    return needed


def _pdf(board: Board, tag_mm: float | None) -> bytes:
    """Return a one-page PDF: filled rectangles in points, y up."""
    outlines, signs, (width, height) = _inked(board, tag_mm)
    page_width, page_height = _page_mm(width, height)
    left = (page_width - width) / 2.0
    top = page_height - (page_height - _NOTE_MM - height) / 2.0
    lines = []
    for outline, sign in zip(outlines, signs, strict=True):
        corner = outline.min(axis=0) + np.array([left, top])
        side = np.ptp(outline[:, 0])
        box = np.array([*corner, side, side]) * _POINT_PER_MM
        lines.append(f"{0 if sign > 0 else 1} g")
        lines.append(" ".join(f"{value:.5f}" for value in box) + " re f")
    if tag_mm is not None:
        lines += _cutting_line(board, tag_mm, left, top)
    lines += _notes(board, tag_mm, left, top - height)
    return _pdf_file("\n".join(lines).encode("ascii"), page_width, page_height)


def _cutting_line(board: Board, tag_mm: float, left: float, top: float) -> list[str]:
    """Return a thin line about the tag, a cell away from it."""
    side = tag_mm * 4.0 / 3.0
    x = left + board.size_mm[0] + _TAG_GAP_MM
    box = np.array([x, top - side, side, side]) * _POINT_PER_MM
    return ["0.6 G 0.2 w", " ".join(f"{value:.5f}" for value in box) + " re S"]


def _notes(board: Board, tag_mm: float | None, left: float, bottom: float) -> list[str]:
    """Return a line of known length, and what is printed."""
    x, y = left * _POINT_PER_MM, (bottom - 9.0) * _POINT_PER_MM
    control_mm = 50.0 if board.size_mm[0] >= 50.0 else 10.0
    reach = control_mm * _POINT_PER_MM
    lines = ["0 g 0 G 0.4 w", f"{x:.5f} {y:.5f} m {x + reach:.5f} {y:.5f} l S"]
    for end in (x, x + reach):
        lines.append(f"{end:.5f} {y - 4:.5f} m {end:.5f} {y + 4:.5f} l S")
    note = (
        f"{control_mm:g} mm. Print at 100 %, measure the board, and give measured over "
        "nominal length as --print-scale."
    )
    what = board.describe().split(", printed")[0]
    if tag_mm is not None:
        what += f"; tag {tag_number(board)}, {tag_mm:g} mm"
    for row, text in enumerate((note, what)):
        place = f"{x + (reach + 6 if row == 0 else 0):.3f} {y - 2 - 12 * row:.3f}"
        lines.append(f"BT /F1 8 Tf {place} Td ({text}) Tj ET")
    return lines


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


def _png(board: Board, dpi: int, tag_mm: float | None) -> bytes:
    """Return a grey PNG with its resolution inside (the pHYs chunk)."""
    px_per_mm = dpi / 25.4
    margin = round(MARGIN_MM * px_per_mm)
    outlines, signs, size_mm = _inked(board, tag_mm)
    width, height = (round(side * px_per_mm) + 2 * margin for side in size_mm)
    pixels = [
        outline * (px_per_mm, -px_per_mm) + (margin - 0.5) for outline in outlines
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
