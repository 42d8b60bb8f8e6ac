"""The harness that predicts published experiments: beam theory, and bad tables."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from magbend.core.errors import ConfigError
from magbend.core.units import MU0

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
HEADS = (
    "experiment,source,shape,length_mm,length_sd_mm,diameter_mm,width_mm,height_mm,"
    "size_sd_mm,E_MPa,E_sd_MPa,remanence_mT,remanence_sd_mT,flux_mT,flux_sd_mT,"
    "angle_deg,angle_sd_deg,quantity,value,value_sd"
)


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "bench_published", BENCHMARKS / "bench_published.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclass looks itself up
    spec.loader.exec_module(module)
    return module


def table(folder: Path, *rows: str, heads: str = HEADS) -> Path:
    path = folder / "made_up.csv"
    path.write_text("\n".join([heads, *rows]), encoding="utf-8")
    return path


def row(
    quantity: str,
    value: float,
    *,
    shape: str = "round",
    E_sd: float = 0.0,
    **new: float,
) -> str:
    """Return a rod 20 mm long and 1 mm thick, 3 MPa, 100 mT, in 0.1 mT."""
    at = {"flux": 0.1, "angle": 90.0, "angle_sd": 0.0, "value_sd": 0.0} | new
    size = "1,," if shape == "round" else ",1,4"
    return (
        f"made up,nobody,{shape},20,0,{size},0,3,{E_sd},100,0,{at['flux']},0,"
        f"{at['angle']},{at['angle_sd']},{quantity},{value},{at['value_sd']}"
    )


def slope(shape: str) -> float:
    """Return M B A L^2 / (2 E I): the tip angle of a rod that hardly bends."""
    area, inertia = {
        "round": (np.pi / 4, np.pi / 64),
        "rectangle": (4.0, 4.0 / 12),
    }[shape]
    return 0.1 * 0.1e-3 / MU0 * area * 20.0**2 / (2 * 3e6 * inertia)


@pytest.mark.parametrize("shape", ["round", "rectangle"])
def test_small_bending_is_that_of_beam_theory(
    bench: ModuleType, tmp_path: Path, shape: str
) -> None:
    truth = slope(shape)
    rows = bench.predict(
        table(
            tmp_path,
            row("tip_angle_deg", 0.0, shape=shape),
            row("tip_y_mm", 0.0, shape=shape),
            row("tip_y_per_length", 0.0, shape=shape),
        ),
        draws=3,
    )
    expected = [np.degrees(truth), truth * 2 / 3 * 20.0, truth * 2 / 3]
    assert [r.predicted for r in rows] == pytest.approx(expected, rel=1e-3)
    assert [r.high - r.low for r in rows] == pytest.approx([0, 0, 0], abs=1e-12)
    assert not any(r.inside for r in rows)


def test_the_band_is_as_wide_as_what_is_stated(
    bench: ModuleType, tmp_path: Path
) -> None:
    truth = np.degrees(slope("round"))
    path = table(
        tmp_path,
        row("tip_angle_deg", truth, E_sd=0.15),
        row("tip_angle_deg", truth * 1.05, value_sd=0.05 * truth),
        row("tip_angle_deg", truth * 1.3, E_sd=0.15),
    )
    stiff, read, far = bench.predict(path, draws=4000)
    for one in (stiff, read):  # 5 % either way: 1.96 deviations
        assert (one.high - one.low) / truth == pytest.approx(2 * 1.96 * 0.05, rel=0.08)
    assert [stiff.inside, read.inside, far.inside] == [True, True, False]


def test_a_rod_turned_to_either_side_counts_as_its_mirror_image(
    bench: ModuleType, tmp_path: Path
) -> None:
    path = table(
        tmp_path,
        row("tip_angle_deg", 0.0, flux=60.0, angle=180.0, angle_sd=1.0),
        row("tip_angle_deg", 0.0, flux=60.0, angle=179.0),
        row("tip_angle_deg", 0.0, flux=60.0, angle=181.0),
    )
    either, left, right = bench.predict(path, draws=200)
    assert left.predicted == pytest.approx(right.predicted, rel=1e-9)
    assert left.predicted > 90.0
    assert 0.0 < either.low <= left.predicted <= either.high


def test_a_rod_with_weight_and_a_mass_at_its_tip_sags_as_beam_theory_says(
    bench: ModuleType, tmp_path: Path
) -> None:
    heads = HEADS + ",density_kg_m3,density_sd_kg_m3,tip_mass_g,tip_mass_sd_g,"
    heads += "clamp_deg,clamp_sd_deg"
    thing = "made up,nobody,round,20,0,1,,,0,300,0,100,0,0,0,90,0,"
    cells = ",2000,0,0.1,0,0,0"
    down, along, turned, lifted = bench.predict(
        table(
            tmp_path,
            f"{thing}tip_y_mm,0,0{cells}",
            f"{thing}tip_x_mm,0,0{cells}",
            f"{thing}tip_y_mm,0,0,0.001,0,0,0,0.1,0",
            f"{thing.replace('100,0,0', '100,0,20')}tip_y_mm,0,0{cells}",
            heads=heads,
        ),
        draws=3,
    )
    area, inertia = np.pi / 4, np.pi / 64
    w, P = 2000e-9 * area * 9.80665, 0.1e-3 * 9.80665  # N/mm, N
    sag = (w * 20**4 / 8 + P * 20**3 / 3) / (300 * inertia)
    pull = 0.1 * 0.02 / MU0 * area * 1e-6 * 20**3 / 3 / (300 * inertia)
    assert down.predicted == pytest.approx(-sag, rel=1e-4)
    assert along.predicted == pytest.approx(20.0, abs=sag**2 / 20)
    assert turned.predicted == pytest.approx(20 * np.sin(np.radians(0.1)), rel=1e-6)
    assert lifted.predicted == pytest.approx(pull - sag, rel=1e-3)
    assert down.load == 0.1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("round", "oval", "line 2: shape must be one of"),
        ("tip_angle_deg", "tip_x", "line 2: quantity must be one of"),
        ("made up,nobody,round,20,0", "made up,nobody,round,20,-1", "length_sd_mm"),
        ("made up,nobody,round,20,0", "made up,nobody,round,20,", "length_sd_mm"),
    ],
)
def test_a_bad_table_is_refused_with_its_place(
    bench: ModuleType, tmp_path: Path, old: str, new: str, said: str
) -> None:
    path = table(tmp_path, row("tip_angle_deg", 1.0).replace(old, new))
    with pytest.raises(ConfigError, match=said):
        bench.predict(path, draws=2)


def test_a_table_without_deviations_is_refused(
    bench: ModuleType, tmp_path: Path
) -> None:
    path = table(
        tmp_path,
        row("tip_angle_deg", 1.0),
        heads=HEADS.replace("E_sd_MPa", "doubt"),
    )
    with pytest.raises(ConfigError, match="E_sd_MPa"):
        bench.predict(path, draws=2)


def test_the_table_that_the_page_shows_gives_what_it_shows(
    bench: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = BENCHMARKS.parent / "docs" / "explanations" / "published.md"
    shown, printed = re.findall(r"```text\n(.*?)```", page.read_text("utf-8"), re.S)
    mine = tmp_path / "mine.csv"
    mine.write_text(shown, encoding="utf-8")
    bench.print_rows(bench.predict(mine))
    told, expected = capsys.readouterr().out.split(), printed.split()
    numbers = re.compile(r"[-+]?\d+\.\d+")
    assert [numbers.sub("", w) for w in told] == [numbers.sub("", w) for w in expected]
    assert [float(w) for w in told if numbers.fullmatch(w)] == pytest.approx(
        [float(w) for w in expected if numbers.fullmatch(w)], abs=2e-3
    )


def test_every_published_row_has_a_band(bench: ModuleType, tmp_path: Path) -> None:
    rows = []
    for path in sorted((BENCHMARKS / "published").glob("*.csv")):
        rows += bench.predict(path, draws=60)
    assert all(r.low < r.predicted < r.high for r in rows)
    for name in ("large bending, L/C = 41", "wire with a mass"):
        of_it = [r for r in rows if r.experiment == name]
        assert sum(r.inside for r in of_it) >= 0.7 * len(of_it) > 0
    bench.draw(rows, tmp_path / "published.svg")
    drawn = (tmp_path / "published.svg").read_text(encoding="utf-8")
    assert drawn.count("mass at the tip, g") == 2
