"""The one reader of tables: what people save is read right, or refused with a cause."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.core.columns import parse_number, split_unit
from magbend.core.decode import decode_text
from magbend.core.errors import ConfigError
from magbend.core.table import parse_table, read_table

GAPS, FLUX = [70.5, 60.0, 50.25], [38.0, 50.5, 66.0]
POINT = "gap_mm,flux_mT\n70.5,38\n60.0,50.5\n50.25,66\n"
COMMA = "gap_mm;flux_mT\n70,5;38\n60,0;50,5\n50,25;66\n"

READ = {
    "plain": POINT.encode(),
    "bom": b"\xef\xbb\xbf" + POINT.encode(),
    "crlf": POINT.replace("\n", "\r\n").encode(),
    "old mac": POINT.replace("\n", "\r").encode(),
    "utf-16": POINT.replace(",", "\t").encode("utf-16"),
    "utf-16 without a mark": POINT.encode("utf-16-le"),
    "utf-16 big, without a mark": POINT.encode("utf-16-be"),
    "utf-32": POINT.encode("utf-32"),
    "semicolons and decimal commas": COMMA.encode(),
    "a title above the heads": b"mass A,\n" + POINT.encode(),
    "sep line": b"sep=;\r\n" + COMMA.encode(),
    "quoted": b'"gap_mm","flux_mT"\n"70.5","38"\n"60.0","50.5"\n"50.25","66"\n',
    "quoted decimal commas": COMMA.replace("70,5", '"70,5"').encode(),
    "tabs and decimal commas": COMMA.replace(";", "\t").encode(),
    "spaces": b"gap_mm   flux_mT\n 70.5  38\n 60.0  50.5 \n50.25 66\n",
    "blank rows": POINT.encode() + b",\n,\n\n",
    "overhanging empty cells": POINT.replace("\n", ",,\n").encode(),
    "comments": b"# bench 3\n" + POINT.encode() + b"# end\n",
    "heads in a comment": b"# " + POINT.encode(),
    "comsol heads": b"% gap (mm)      flux (mT)\n70.5  38\n60.0 50.5\n50.25 66\n",
    "units in brackets": POINT.replace("gap_mm", "gap [mm]").encode(),
    "another unit": b"gap (m),flux (T)\n.0705,.038\n6e-2,0.0505\n5.025E-2,66e-3\n",
    "gauss": b"gap_cm,flux (G)\n7.05,380\n6.0,505\n5.025,660\n",
    "units below": b"gap,flux\nmm,mT\n70.5,38\n60.0,50.5\n50.25,66\n",
    "units in the heads and below": (
        b"gap_mm,flux (mT)\nmm,mT\n70.5,38\n60.0,50.5\n50.25,66\n"
    ),
    "a note": b'gap_mm,note,flux_mT\n70.5,"warm, again",38\n60,,50.5\n50.25,a,66\n',
    "latin": "gap_mm;flux_mT;Länge µ\n70,5;38;é\n60;50,5;ö\n50,25;66;\n".encode(
        "latin-1"
    ),
    "mac roman": POINT.replace("gap_mm", "é,gap_mm")
    .replace("\n7", "\nü,7").replace("\n6", "\n,6").replace("\n5", "\n,5")
    .replace("\n", "\r").encode("mac-roman"),
    "spaced": b" gap_mm , flux_mT \n 70.5 , 38 \n60.0,50.5\n50.25,66\n",
    "plus sign": POINT.replace("70.5", "+70.5").encode(),
}  # fmt: skip


@pytest.mark.parametrize("kind", READ)
def test_what_people_save_is_read(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(READ[kind])
    table = read_table(path)
    np.testing.assert_allclose(table.numbers("gap_mm"), GAPS, rtol=1e-15)
    np.testing.assert_allclose(table.numbers("flux_mT"), FLUX, rtol=1e-15)


REFUSED = {
    "both commas": (b"x_mm,y_mm\n3,0,0,11\n", "line 2.*more values.*with a point"),
    "quoted comma among commas": (b'x_mm,y_mm\n3,"0,11"\n', "line 2.*with a point"),
    "underscore": (b"x_mm,y_mm\n1_000,2\n", "line 2: x_mm.*1_000.*underscore"),
    "thousands": (b'x_mm\ty_mm\n"1,250"\t2\n', "line 2.*thousands"),
    "points and commas": (b"x_mm;y_mm\n1,5;2.5\n", "line 2.*with a point"),
    "a stray point in another column": (
        b"x_mm;y_mm;warmth\n70,0;1,5;21,5\n60,0;2,5;21.5\n",
        "line 2: x_mm .*'70,0', but line 3 has 21.5 in warmth: write all decimals",
    ),
    "a unit behind a decimal comma": (b"x_mm;y_mm\n38,0 mm;2,5\n", "unit in the head"),
    "German thousands": (b"x_mm;y_mm\n1.250,5;2,5\n", "thousands without a point"),
    "a unit in the cell": (b"x_mm,y_mm\n38 mm,2\n", "line 2.*unit in the head"),
    "nan": (b"x_mm,y_mm\nnan,2\n", "line 2: x_mm must be a number.*leave the row out"),
    "infinity": (b"x_mm,y_mm\n1,inf\n", "line 2: y_mm must be a number"),
    "overflow": (b"x_mm,y_mm\n1,1e999\n", "line 2: y_mm must be a number"),
    "empty cell": (b"x_mm,y_mm\n1,\n", "line 2: y_mm must be a number"),
    "foreign digits": ("x_mm,y_mm\n١,2\n".encode(), "line 2: x_mm must be"),
    "cut off": (b"x_mm,y_mm\n1,2\n3\n", "line 3: has 1 of the 2 values"),
    "no unit": (b"x,y\n1,2\n", "'x' is without a unit; head it x_mm"),
    "another kind of unit": (
        b"x_s,y_mm\n1,2\n",
        "must have the column.s. x_mm; .* x_s, y_mm",
    ),
    "an unknown unit": (b"x (furlong),y_mm\n1,2\n", "is in 'furlong'; head it x_mm"),
    "missing": (b"y_mm,z\n1,2\n", "must have the column.s. x_mm; .* y_mm, z"),
    "no heads": (b"1,2\n3,4\n", "first line must name the columns"),
    "heads alone": (b"x_mm,y_mm\n", "at least one row"),
    "nothing": (b"\n\n", "holds no row"),
    "twice": (b"x_mm,x_mm,y_mm\n1,2,3\n", "2 columns named x_mm"),
    "twice in two units": (b"x (m),x (cm),y_mm\n1,2,3\n", "both x"),
    "excel": (b"PK\x03\x04rest", "Excel.*save it as CSV"),
    "zero bytes": (b"x_mm,y_mm\n1,\x002\n", "zero bytes"),
    "an endless cell": (b"x_mm,y_mm\n1," + b"2" * 200_000 + b"\n", "field larger"),
    "an endless row": (b"x_mm,y_mm\n" + b"1," * 9000 + b"\n", "line 2.*4096 columns"),
}


def _read_both(path: Path) -> None:
    table = read_table(path)
    table.numbers("x_mm")
    table.numbers("y_mm")


@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_read_is_refused_with_its_cause(
    kind: str, tmp_path: Path
) -> None:
    data, words = REFUSED[kind]
    path = tmp_path / "t.csv"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=words) as caught:
        _read_both(path)
    assert "t.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_over_the_limit_a_folder_and_a_missing_one_are_refused(
    tmp_path: Path,
) -> None:
    path = tmp_path / "t.csv"
    path.write_text(POINT)
    with pytest.raises(ConfigError, match="longer than 1e-05 MB"):
        read_table(path, limit_MB=1e-5)
    with pytest.raises(ConfigError, match="is a folder"):
        read_table(tmp_path)
    with pytest.raises(ConfigError, match="no such file"):
        read_table(tmp_path / "none.csv")


def test_a_row_may_begin_with_a_sign_where_comments_are_off() -> None:
    text = "image,x_mm\n#1.png,2\n"
    table = parse_table(text, Path("t"), comments="")
    assert table.texts("image") == ["#1.png"]
    with pytest.raises(ConfigError, match="at least one row"):
        parse_table(text, Path("t"))


def test_blanks_are_nan_where_they_are_allowed() -> None:
    table = parse_table("x_mm,y_mm\n1,\n,nan\n3,4\n", Path("t"))
    np.testing.assert_equal(table.numbers("x_mm", blanks=True), [1.0, np.nan, 3.0])
    np.testing.assert_equal(table.numbers("y_mm", blanks=True), [np.nan, np.nan, 4.0])


@pytest.mark.parametrize(
    ("head", "parts"),
    [
        ("x_mm", ("x", "mm")),
        ("x (mm)", ("x", "mm")),
        ("Flux density [mT]", ("Flux_density", "mT")),
        ("kappa_per_mm", ("kappa", "per_mm")),
        ("density_kg_m3", ("density", "kg_m3")),
        ("theta(°)", ("theta", "°")),
        ("image", ("image", "")),
        ("frame_status", ("frame_status", "")),
    ],
)
def test_a_head_parts_into_quantity_and_unit(head: str, parts: tuple[str, str]) -> None:
    assert split_unit(head) == parts


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_written_is_the_number_read(value: float) -> None:
    assert parse_number(repr(value)) == value
    assert parse_number(repr(value).replace(".", ","), decimal_comma=True) == value


@given(st.text(max_size=12))
def test_no_text_is_read_more_freely_than_python_reads_it(text: str) -> None:
    value = parse_number(text)
    if value is not None:
        assert value == float(
            text.strip().replace("\u2212", "-").lower().replace("d", "e")
        )


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused_in_one_sentence(data: bytes) -> None:
    path = Path("any.csv")
    said = "any.csv"
    try:
        parse_table(decode_text(data, path), path)
    except ConfigError as error:
        said = str(error)
    assert said.startswith("any.csv")
