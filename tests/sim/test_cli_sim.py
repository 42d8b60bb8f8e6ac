"""``magbend sim``: what is typed, what is printed, what is written."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer import BadParameter
from typer.testing import CliRunner

from magbend.cli import main, sim
from magbend.core.centreline import Centreline
from magbend.core.errors import ConfigError, InputError, SolverError
from magbend.core.specimen_file import read_specimen
from magbend.sim import Uniform, UniformField, gmc, solve, solve_spatial
from magbend.sim.study.sweep import STUDIES, sweep

SPECIMENS = Path(__file__).resolve().parents[2] / "fixtures" / "specimens"
RUN = CliRunner()


def run(*arguments: str) -> str:
    """Run ``magbend sim`` and return its output; errors come out as exceptions."""
    result = RUN.invoke(sim.app, list(arguments), standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.stdout


def test_shape_prints_the_reference_tip() -> None:
    text = run("shape", "--gmc", "2", "--field-mT", "50", "--angle-deg", "90")
    assert "(29.53532, 4.70952) mm" in text
    assert "stable" in text


def test_shape_writes_twelve_digits_and_json(tmp_path: Path) -> None:
    out = tmp_path / "shape.csv"
    text = run("shape", "--gmc", "2", "--field-mT", "50", "--out", str(out), "--json")
    data = json.loads(text)
    line = Centreline.from_csv(out)
    assert len(line.s_mm) == 61
    assert line.tip_mm == pytest.approx((29.5353236353478, 4.70952405678937), abs=1e-12)
    assert data["tip_mm"] == pytest.approx(line.tip_mm, abs=1e-13)
    assert data["status"] == "stable"
    assert len(data["s_mm"]) == 61


def test_a_rod_lifted_out_of_the_plane_keeps_its_height(tmp_path: Path) -> None:
    """A field that points up lifts the tip, seen nowhere in x and y alone."""
    source, out = tmp_path / "up.toml", tmp_path / "shape.csv"
    source.write_text(
        '[[source]]\nkind = "uniform"\nflux_mT = 50.0\nelevation_deg = 40.0\n'
    )
    case = ("shape", "--gmc", "2", "--magnet", str(source))
    text = run(*case, "--out", str(out))
    data = json.loads(run(*case, "--json"))
    field = Uniform(flux_mT=50.0, elevation_deg=40.0)
    x, y, z = solve_spatial(gmc(2), field).r_mm[-1]
    assert z > 2.0
    assert f"({x:.5f}, {y:.5f}, {z:.5f}) mm" in text
    assert "N m about z" in text
    assert "mT in x and y" in text
    assert "sag" not in text
    assert (*data["tip_mm"], data["tip_z_mm"]) == pytest.approx((x, y, z), abs=1e-8)
    table = np.genfromtxt(out, delimiter=",", names=True)
    assert table["z_mm"][-1] == pytest.approx(z, abs=1e-8)
    assert Centreline.from_csv(out).tip_mm == pytest.approx((x, y), abs=1e-8)


def test_poissons_ratio_is_that_of_the_file(tmp_path: Path) -> None:
    """The solid takes the file's unless told another; the plain rod takes no other."""
    rod = tmp_path / "rod.toml"
    text = (SPECIMENS / "gmc2.toml").read_text()
    rod.write_text(text.replace("remanence_mT", "poisson_ratio = 0.3\nremanence_mT", 1))
    case = ("shape", "--specimen", str(rod), "--field-mT", "50", "--json")

    def tip(*more: str) -> list[float]:
        found: list[float] = json.loads(run(*case, *more))["tip_mm"]
        return found

    assert tip("--model", "solid") == tip("--model", "solid", "--poisson", "0.3")
    assert tip("--model", "solid") != tip("--model", "solid", "--poisson", "0.49")
    with pytest.raises(BadParameter, match="--model solid"):
        tip("--poisson", "0.3")


def test_a_tube_is_shown_as_a_solid(tmp_path: Path) -> None:
    """Shear and oval sections, a fixed face: a little off the rod, as in Python."""
    file = tmp_path / "tube.toml"
    file.write_text(
        'name = "tube"\nshape = "tube"\ndiameter_mm = 1.2\nbore_mm = 0.6\n'
        "remanence_mT = 40\n\n[[section]]\nlength_mm = 24\nE_MPa = 3\n"
    )
    case = ("shape", "--specimen", str(file), "--field-mT", "40", "--json")
    plain, solid = (
        np.array(json.loads(run(*case, "--model", model))["tip_mm"])
        for model in ("rod", "solid")
    )
    found = solve(read_specimen(file), UniformField(flux_mT=40.0), model="solid")
    assert solid == pytest.approx(found.centreline.tip_mm, abs=1e-9)
    off = np.linalg.norm(solid - plain) / np.linalg.norm(plain - [24.0, 0.0])
    assert 1e-3 < off < 1e-2


def test_specimen_file_is_the_table(tmp_path: Path) -> None:
    for number in range(1, 8):
        path = SPECIMENS / f"gmc{number}.toml"
        assert read_specimen(path) == gmc(number)
    text = run("shape", "--specimen", str(path), "--field-mT", "50", "--json")
    same = run("shape", "--gmc", "7", "--field-mT", "50", "--json")
    assert json.loads(text)["tip_mm"] == json.loads(same)["tip_mm"]


def test_magnet_weight_and_check(tmp_path: Path) -> None:
    magnet = tmp_path / "magnet.toml"
    magnet.write_text("side_mm = 55.0\nremanence_T = 1.305\n")
    text = run(
        "shape", "--gmc", "2", "--magnet", str(magnet), "--gap-mm", "60", "--verify",
        "--density-kg-m3", "2640", "--gravity-m-s2", "0", "-9.80665", "0", "--json",
    )  # fmt: skip
    data = json.loads(text)
    assert data["tip_mm"][1] == pytest.approx(2.714, abs=2e-3)
    assert data["check_mm"] < 1e-8


def test_check_of_a_rod_that_leaves_the_plane() -> None:
    case = (
        "shape", "--gmc", "2", "--field-mT", "50", "--density-kg-m3", "2640",
        "--gravity-m-s2", "0", "0", "-9.80665", "--verify",
    )  # fmt: skip
    data = json.loads(run(*case, "--json"))
    assert data["sag_mm"] > 0.1
    assert 0.0 < data["check_mm"] < data["error_mm"]
    assert f"least energy agrees to {data['check_mm']:.1e} mm" in run(*case)


def test_pulled_in_has_no_shape_to_write(tmp_path: Path) -> None:
    rod = tmp_path / "rod.toml"
    rod.write_text(
        'name = "soft"\nside_mm = 0.75\nremanence_mT = -150\n'
        "[[section]]\nlength_mm = 30\nE_MPa = 10\n"
    )
    magnet = tmp_path / "magnet.toml"
    magnet.write_text("side_mm = 55.0\nremanence_T = 1.305\n")
    without = ["shape", "--specimen", str(rod), "--magnet", str(magnet)]
    assert RUN.invoke(sim.app, without).exit_code == 2
    case = ("shape", "--specimen", str(rod), "--magnet", str(magnet), "--gap-mm", "20")
    assert "pulled in: no equilibrium" in run(*case)
    assert ", where the tip of the straight rod is" in run(*case)
    assert "none: there is no shape" in run(*case, "--verify")
    out = tmp_path / "shape.csv"
    with pytest.raises(SolverError, match="no shape to write"):
        run(*case, "--out", str(out))
    assert not out.exists()


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("--gmc", "2"),
        ("--gmc", "2", "--specimen", "x.toml", "--field-mT", "5"),
        ("--gmc", "2", "--field-mT", "5", "--magnet", "m.toml"),
        ("--gmc", "2", "--field-mT", "5", "--gap-mm", "5"),
        ("--gmc", "2", "--field-mT", "5", "--points", "3"),
        ("--gmc", "two", "--field-mT", "5"),
    ],
)
def test_wrong_usage_ends_with_2(arguments: tuple[str, ...]) -> None:
    result = RUN.invoke(sim.app, ["shape", *arguments])
    assert result.exit_code == 2


@pytest.mark.parametrize(
    ("arguments", "owner"),
    [
        ("shape --magnet m.toml --angle-deg 30", "--field-mT"),
        ("shape --field-mT 5 --density-kg-m3 2000", "--gravity-m-s2"),
        ("shape --field-mT 5 --points 70", "--out or --json"),
        ("shape --field-mT 5 --model solid --verify", "--model rod"),
        ("shape --field-mT 5 --poisson 0.3", "--model solid"),
        ("equilibria --magnet m.toml --gap-mm 60 --angle-deg 30", "a uniform field"),
        ("path --magnet m.toml --gap-mm 60:50 --angle-deg 30", "--field-mT"),
        ("sweep field --field-mT 20", "the studies that keep it"),
        ("sweep angle --angle-deg 20", "the studies that keep it"),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(
    arguments: str, owner: str
) -> None:
    command, *rest = arguments.split()
    with pytest.raises(BadParameter, match=f"belongs to {owner}"):
        run(command, "--gmc", "2", *rest)


@pytest.mark.parametrize(
    ("arguments", "pattern"),
    [
        (("--gmc", "9", "--field-mT", "5"), "GMC number"),
        (("--gmc", "2", "--field-mT", "100000"), r"flux_mT.*mT"),
        (("--gmc", "2", "--field-mT", "nan"), r"flux_mT.*mT"),
        (
            ("--gmc", "2", "--field-mT", "5", "--gravity-m-s2", "0", "-9", "0"),
            "density",
        ),
        (("--specimen", "missing.toml", "--field-mT", "5"), "no such file"),
    ],
)
def test_mistakes_are_sentences(arguments: tuple[str, ...], pattern: str) -> None:
    with pytest.raises((InputError, ConfigError), match=pattern):
        run("shape", *arguments)


def test_a_source_file_of_bytes_is_refused_in_a_sentence(tmp_path: Path) -> None:
    file = tmp_path / "bytes.toml"
    file.write_bytes(b"\xff\xd6")
    with pytest.raises(ConfigError, match="is not a text file"):
        run("shape", "--gmc", "2", "--magnet", str(file))


def test_the_sentence_is_printed_and_the_exit_code_is_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("MAGBEND_DEBUG", raising=False)
    monkeypatch.setattr(
        sys, "argv", ["magbend", "sim", "shape", "--gmc", "9", "--field-mT", "5"]
    )
    with pytest.raises(SystemExit) as stop:
        main.main()
    assert stop.value.code == 1
    assert "GMC number must be from 1 to 7" in capsys.readouterr().err


def test_magnet_prints_the_verdicts(tmp_path: Path) -> None:
    figure = tmp_path / "map.svg"
    text = run("magnet", "--map", str(figure))
    for part in ("1.3578", "1.3050", "1.2186", "1.2938", "70.07"):
        assert part in text
    assert figure.read_text(encoding="utf-8").lstrip().startswith("<?xml")
    readings = tmp_path / "readings.csv"
    readings.write_text("gap_mm,flux_mT\n70,38\n60,50\n")
    data = json.loads(run("magnet", str(readings), "--json"))
    assert len(data["readings"]) == 2
    assert data["remanence_T"] == pytest.approx(1.331, abs=2e-3)
    assert "paper" not in data


def test_sweep_writes_a_figure_and_a_table_each(tmp_path: Path) -> None:
    out = tmp_path / "studies"
    text = run("sweep", "--out", str(out))
    for name in STUDIES:
        assert (out / f"{name}.svg").stat().st_size > 1000
        assert (out / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        rows = (out / f"{name}.csv").read_text(encoding="utf-8").splitlines()
        assert len(rows) == 1 + 61 * len(STUDIES[name].values)
        assert name in text


def test_sweep_takes_values(tmp_path: Path) -> None:
    text = run("sweep", "field", "--values", "10, 20", "--out", str(tmp_path), "--json")
    shapes = json.loads(text)["shapes"]
    assert [shape["value"] for shape in shapes] == ["10", "20"]
    assert shapes[1]["tip_mm"][1] > shapes[0]["tip_mm"][1]


def test_studies_bend_the_way_the_paper_says() -> None:
    # A larger field, a softer rod, a longer soft end and a thinner rod bend more.
    field = UniformField(flux_mT=50.0)
    for name in ("field", "stiffness", "length", "side"):
        lines = [shape.solution.centreline for shape in sweep(name, gmc(2), field)]
        angles = [line.theta_rad[-1] for line in lines if line is not None]
        assert np.all(np.diff(angles) > 0.0), name


@pytest.mark.parametrize(
    ("name", "value"),
    [("field", "much"), ("stiffness", "0"), ("length", "10-10"), ("side", "-1")],
)
def test_bad_values_of_a_study_are_refused(name: str, value: str) -> None:
    with pytest.raises(InputError):
        sweep(name, gmc(2), UniformField(flux_mT=50.0), values=[value])


def test_sweep_refuses_its_folder_before_it_solves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def began(*_: object, **__: object) -> None:
        raise AssertionError("the work began before --out was checked")

    monkeypatch.setattr("magbend.sim.sweep", began)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="a file stands where a folder belongs"):
        run("sweep", "field", "--out", str(tmp_path / "file"))
