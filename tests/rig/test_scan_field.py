from __future__ import annotations

from pathlib import Path

import pytest

from magbend.core.errors import StoreError
from magbend.rig.errors import InterlockError, LinkLostError
from magbend.rig.runs.scan_field import scan_field
from magbend.sim.magnet.readings import read_readings


def test_a_scan_writes_a_table_that_sim_magnet_reads(bench, tmp_path: Path) -> None:
    gaps = (100.0, 80.0, 60.0)
    found = scan_field(bench.devices, gaps, tmp_path / "s", samples=25)
    gaps_mm, flux_mT, sd_mT = read_readings(found.path)
    assert tuple(gaps_mm) == gaps
    assert flux_mT == pytest.approx([38.0 * (70.0 / g) ** 2 for g in gaps], abs=0.1)
    assert sd_mT == pytest.approx([0.05] * 3, rel=0.6)
    assert found.path.read_text().startswith("gap_mm,flux_mT,sd_mT,n\n")
    moves = [float(c.split()[1]) for c in bench.raw.calls if c.startswith("move")]
    assert moves == sorted(moves, reverse=True)


def test_an_overload_is_a_gap_without_a_row(make_bench, tmp_path: Path) -> None:
    bench = make_bench(meter={"overload_mT": 60.0})
    found = scan_field(bench.devices, (70.0, 50.0), tmp_path / "s")
    assert found.gaps_mm == (70.0,)
    assert found.skipped == ("50 mm: overload",)


def test_one_reading_has_no_scatter_and_no_such_column(bench, tmp_path: Path) -> None:
    found = scan_field(bench.devices, (70.0,), tmp_path / "s", samples=1)
    assert found.path.read_text().startswith("gap_mm,flux_mT,n\n")
    assert read_readings(found.path)[2] is None


def test_what_was_read_survives_a_lost_link(bench, tmp_path: Path) -> None:
    def before(call: str) -> None:
        if call == "move -90":
            raise LinkLostError("gone")

    bench.raw.before = before
    with pytest.raises(LinkLostError):
        scan_field(bench.devices, (70.0, 60.0), tmp_path / "s")
    assert read_readings(tmp_path / "s" / "field.csv")[0] == [70.0]
    assert bench.raw.calls[-1] == "hold"


def test_limits_and_older_tables_are_respected(bench, tmp_path: Path) -> None:
    with pytest.raises(InterlockError):
        scan_field(bench.devices, (70.0, 30.0), tmp_path / "s")
    assert bench.raw.calls == ["connect"]
    (tmp_path / "field.csv").write_text("mine")
    with pytest.raises(StoreError, match="was not made by magbend"):
        scan_field(bench.devices, (70.0,), tmp_path)
    scan_field(bench.devices, (70.0,), tmp_path / "s")
    with pytest.raises(StoreError, match="there already"):
        scan_field(bench.devices, (70.0,), tmp_path / "s")
