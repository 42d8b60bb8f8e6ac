from __future__ import annotations

import os
from pathlib import Path

import pytest

from magbend.core.errors import ConfigError, StoreError
from magbend.rig.bench.config import SettleConfig, read_plan, read_rig
from magbend.rig.bench.template import write_templates
from magbend.rig.runs.dry_run import homing_s, plan_steps

from .conftest import RIG, SPECIMEN


def test_a_plan_brings_its_rig_and_specimen(plan_file: Path) -> None:
    plan = read_plan(plan_file)
    assert plan.gaps_mm == (70.0, 60.0, 50.0)
    assert plan.specimen.name == "GMC 2"
    assert plan.rig.limits.min_gap_mm == 40.0
    assert plan.rig.magnet.magnet().sides_mm == (55.0, 55.0, 55.0)
    assert plan.settle.frames == 3
    assert "specimen" not in plan.as_dict()


def test_a_specimen_may_stand_in_the_plan(plan_file: Path) -> None:
    text = plan_file.read_text().replace('specimen = "specimen.toml"\n', "")
    inline = '[specimen]\nname = "own"\nside_mm = 1.0\nremanence_mT = 20.0\n'
    section = "[[specimen.section]]\nlength_mm = 12.0\nE_MPa = 9.0\n"
    plan_file.write_text(text + inline + section)
    assert read_plan(plan_file).specimen.length_mm == 12.0
    plan_file.write_text(text + inline.replace("side_mm", "side") + section)
    with pytest.raises(ConfigError, match=r"line \d+: unknown key 'specimen.side'; th"):
        read_plan(plan_file)


@pytest.mark.skipif(os.name != "posix", reason="links are of POSIX")
@pytest.mark.parametrize("name", ["specimen.toml", "rig.toml"])
def test_a_ring_of_links_is_a_file_that_cannot_be_read(
    plan_file: Path, name: str
) -> None:
    plan_file.with_name(name).unlink()
    plan_file.with_name(name).symlink_to(name)
    with pytest.raises(ConfigError, match=f"{name}: cannot be read"):
        read_plan(plan_file)


def test_settle_falls_back_to_the_rig_and_then_to_defaults(plan_file: Path) -> None:
    text = plan_file.read_text()
    plan_file.write_text(text[: text.index("[settle]")])
    assert read_plan(plan_file).settle == SettleConfig()
    rig = plan_file.with_name("rig.toml")
    rig.write_text(rig.read_text() + "[settle]\ntime_s = 9.0\n")
    assert read_plan(plan_file).settle.time_s == 9.0


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "[70.0, 60.0, 50.0]",
            "[70.0, 60.0, 30]",
            r"plan.toml, line 6: gaps_mm\[2\] = 30 mm is under the interlock of 40 mm "
            r"\(rig.toml, limits.min_gap_mm\)",
        ),
        ("[70.0, 60.0, 50.0]", "[200, 60]", r"gaps_mm\[0\] = 200 mm is beyond"),
        ("[70.0, 60.0, 50.0]", "[70, 70]", "must fall"),
        ("[70.0, 60.0, 50.0]", "[60, 70]", "far side"),
        ("[70.0, 60.0, 50.0]", "[]", "line 6: gaps_mm"),
        ("[70.0, 60.0, 50.0]", "[-70]", "line 6: gaps_mm.0"),
        ("[70.0, 60.0, 50.0]", "[nan]", "line 6: gaps_mm.0"),
        ("[70.0, 60.0, 50.0]", '["70 mm"]', "line 6: gaps_mm.0"),
        ("gaps_mm =", "gaps =", "line 6: unknown key 'gaps'; the unit is missing"),
        ("timeout_s = 20.0", "timeout = 20.0", "unknown key 'settle.timeout'"),
        ("frames = 3", "frames = 1", "settle.frames"),
        ('specimen = "specimen.toml"', 'specimen = "no.toml"', "no.toml: there is no"),
        ('rig = "rig.toml"', 'rig = "no.toml"', "no.toml: there is no such file"),
        ('rig = "rig.toml"\n', "", "'rig' is missing"),
        ('name = "gmc2"', "name = ", "not valid TOML"),
    ],
)
def test_a_wrong_plan_is_one_sentence(plan_file, old, new, sentence) -> None:
    text = plan_file.read_text()
    assert old in text
    plan_file.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=sentence) as caught:
        read_plan(plan_file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('backend = "twin"', 'backend = "webcam"', "camera.backend"),
        ("min_gap_mm = 40.0", "min_gap = 40.0", "the unit is missing"),
        ("side_mm = 55.0\n", "", "either side_mm"),
        ("[limits]", "[limit]", "unknown key 'limit'; did you mean 'limits'"),
        ('driver = "twin"', 'driver = "twin"\nsign = 2', "meter.sign"),
        ('port = "none"', 'home_command = "$HY"', r"'\$H' .* or '\$HX'"),
        ('port = "none"', 'home_command = "$HELP"', "home_command must be"),
        (
            'port = "none"',
            'driver = "marlin"\nsettings = { "$22" = 1 }',
            "a Marlin board has none",
        ),
    ],
)
def test_a_wrong_rig_is_one_sentence(plan_file, old, new, sentence) -> None:
    rig = plan_file.with_name("rig.toml")
    text = rig.read_text()
    assert old in text
    rig.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=sentence):
        read_rig(rig)


def test_the_dry_run_adds_up(plan_file: Path) -> None:
    plan = read_plan(plan_file)
    steps = plan_steps(plan)
    assert [step.stage_mm for step in steps] == [-80.0, -90.0, -100.0]
    assert [step.move_mm for step in steps] == [79.0, 10.0, 10.0]
    # 10 mm at 5 mm/s, half a second to speed up and down, then the fixed times.
    assert steps[1].time_s > 2.5 + plan.settle.time_s
    assert homing_s(plan) > 0.0


def test_a_plan_beyond_the_travel_is_refused_before_any_device(plan_file) -> None:
    rig = plan_file.with_name("rig.toml")
    rig.write_text(RIG.replace('port = "none"', "travel_mm = 95.0"))
    with pytest.raises(ConfigError, match=r"gaps_mm\[2\] = 50 mm lies 100 mm from"):
        read_plan(plan_file)


HEAVY = SPECIMEN.replace("side_mm = 1.0", "side_mm = 1.0\ndensity_kg_m3 = 2640.0")


@pytest.mark.parametrize(
    ("bench", "specimen", "gravity"),
    [
        ("", HEAVY, (0.0, 0.0, 0.0)),
        ("[bench]\nup = [0, 0, 1]", SPECIMEN, (0.0, 0.0, 0.0)),
        ("[bench]\nup = [0, 0, 1]", HEAVY, (0.0, 0.0, -9.80665)),
        ("[bench]\nup = [-3, 0, 0]", HEAVY, (9.80665, 0.0, 0.0)),
        ("[bench]\nup = [0, 3, 4]", HEAVY, (0.0, -5.88399, -7.84532)),
    ],
)
def test_weight_is_how_the_bench_stands_and_what_the_rod_weighs(
    plan_file, bench, specimen, gravity
) -> None:
    rig = plan_file.with_name("rig.toml")
    rig.write_text(rig.read_text() + bench)
    plan_file.with_name("specimen.toml").write_text(specimen)
    assert read_plan(plan_file).gravity_m_s2 == pytest.approx(gravity)


@pytest.mark.parametrize("up", ["[0, 0, 0]", "[0, 1]", "[nan, 0, 1]", '"up"'])
def test_a_bench_that_has_no_up_is_refused(plan_file, up) -> None:
    rig = plan_file.with_name("rig.toml")
    rig.write_text(rig.read_text() + f"[bench]\nup = {up}\n")
    with pytest.raises(ConfigError, match="bench"):
        read_rig(rig)


def test_the_dry_run_predicts_with_the_weight_of_the_bench(plan_file) -> None:
    import json

    from typer.testing import CliRunner

    from magbend.cli.main import app

    rig = plan_file.with_name("rig.toml")
    plan_file.with_name("specimen.toml").write_text(HEAVY)
    words = ["rig", "run", str(plan_file), "--dry-run"]

    def tip_y_mm(up: str) -> float:
        whole = RIG.replace('"none"', '"auto"')  # all of the bench is computed
        rig.write_text(whole + f"[bench]\nup = {up}\n")
        result = CliRunner().invoke(app, [*words, "--json"])
        return json.loads(result.stdout)["steps"][0]["predicted_tip_y_mm"]

    above, on_edge, turned = map(tip_y_mm, ("[0, 0, 1]", "[0, 1, 0]", "[0, -1, 0]"))
    assert on_edge < above < turned
    assert "with weight: 0.00, 9.81, 0.00" in CliRunner().invoke(app, words).stdout


@pytest.mark.parametrize("twin", [False, True])
def test_templates_are_valid_and_never_overwrite(tmp_path: Path, twin: bool) -> None:
    folder = tmp_path / "bench"
    paths = write_templates(folder, twin=twin)
    plan = read_plan(folder / "plan.toml")
    assert plan.specimen.length_mm == 30.0
    assert plan.rig.camera.backend == ("twin" if twin else "auto")
    assert all("#" in path.read_text() for path in paths)
    with pytest.raises(StoreError, match="is not overwritten"):
        write_templates(folder)


def test_the_files_in_fixtures_are_those_of_rig_init(tmp_path: Path) -> None:
    folder = Path(__file__).parents[2] / "fixtures" / "plans"
    for path in write_templates(tmp_path, twin=True):
        assert (folder / path.name).read_text() == path.read_text(), path.name


@pytest.mark.parametrize("name", ["plan.toml", "inline.toml"])
def test_the_plans_in_fixtures_are_valid(name: str) -> None:
    folder = Path(__file__).parents[2] / "fixtures" / "plans"
    plan = read_plan(folder / name)
    assert plan.rig.camera.backend == "twin"
    assert len(plan_steps(plan)) == len(plan.gaps_mm)
