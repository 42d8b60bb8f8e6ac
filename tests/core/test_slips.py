"""A number of the size of another unit is asked about; an unusual one is taken."""

from __future__ import annotations

from pathlib import Path

import pytest

from magbend.core.errors import InputError
from magbend.core.slips import refuse_slip, slip_of
from magbend.core.specimen_file import read_magnet, read_specimen

ROD = """name = "GMC 2"
side_mm = 1.0
remanence_mT = 20.07
density_kg_m3 = 2640
[[section]]
length_mm = 10.0
E_MPa = 20.0
"""
MAGNET = "side_mm = 55.0\nremanence_T = 1.305\n"

SLIPS = {
    "E in Pa": ("E_MPa = 20.0", "E_MPa = 20e6", "line 7: .*in Pa.*write 20"),
    "length in m": ("length_mm = 10.0", "length_mm = 0.01", "line 6: .*in m.*write 10"),
    "side in m": ("side_mm = 1.0", "side_mm = 0.001", "line 2: .*in m.*write 1"),
    "remanence in A/m": ("20.07", "15971", r"line 3: .*in A/m.*write 20\.069"),
    "remanence in T": ("20.07", "0.02007", r"line 3: .*in T.*write 20\.07"),
    "remanence in T, negative": ("20.07", "-0.02007", r"write -20\.07"),
    "density in g/cm3": ("2640", "2.64", "line 4: .*in g/cm3.*write 2640"),
}


@pytest.mark.parametrize("kind", SLIPS)
def test_a_slip_in_a_specimen_is_asked_about_with_its_line(
    kind: str, tmp_path: Path
) -> None:
    right, wrong, words = SLIPS[kind]
    path = tmp_path / "rod.toml"
    path.write_text(ROD.replace(right, wrong))
    with pytest.raises(InputError, match=words):
        read_specimen(path)


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        ("1.305", "1305", r"in mT.*write 1\.305"),
        ("1.305", "13.05", r"in kG.*write 1\.305"),
        ("1.305", "1.04e6", r"in A/m.*write 1\.3069"),
        ("55.0", "0.055", "in m.*write 55"),
    ],
)
def test_a_slip_in_a_magnet_is_asked_about(
    right: str, wrong: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "cube.toml"
    path.write_text(MAGNET.replace(right, wrong))
    with pytest.raises(InputError, match=words):
        read_magnet(path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("E_MPa", 0.01), ("E_MPa", 2e5), ("length_mm", 0.5), ("length_mm", 900.0),
        ("side_mm", 0.05), ("remanence_mT", 0.0), ("remanence_mT", -1400.0),
        ("remanence_T", -1.45), ("density_kg_m3", 8000.0), ("gap_mm", 1.0),
        ("unheard_of", 1e99),
    ],
)  # fmt: skip
def test_unusual_rods_are_taken(name: str, value: float) -> None:
    assert slip_of(name, value) == ""


def test_options_are_asked_about_too() -> None:
    refuse_slip("flux_mT", 50.0)
    refuse_slip("gap_mm", None)
    with pytest.raises(InputError, match=r"gap_mm: .*in m.*write 70"):
        refuse_slip("gap_mm", 0.07)
