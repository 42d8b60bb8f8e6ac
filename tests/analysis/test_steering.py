"""A steered way is a plan of the rig's, and leads the true rod through its gate."""

from __future__ import annotations

import itertools
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from magbend.analysis.twin.lumen_bench import LumenBench
from magbend.cli import sim
from magbend.core.errors import InputError
from magbend.rig import read_plan, write_templates
from magbend.sim import UniformField, gmc
from magbend.sim.navigate import Steered, crosses, lumen_of, navigate, plan_of

LUMENS = Path(__file__).parents[2] / "fixtures" / "lumens"
AXES = """
[[axis]]
name = "insertion_mm"
driver = "twin"
min = 0.0
max = 30.0

[[axis]]
name = "axis_angle_deg"
driver = "twin"
min = -120.0
max = 120.0
"""


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("steer")
    write_templates(folder, twin=True)
    (folder / "fork.toml").write_text((LUMENS / "fork.toml").read_text())
    rig = folder / "rig.toml"
    rig.write_text(rig.read_text() + AXES)
    result = CliRunner().invoke(
        sim.app,
        ["steer", str(folder / "fork.toml"), "--gate", "right branch", "--specimen",
         str(folder / "specimen.toml"), "--rig", str(rig), "--every-mm", "8",
         "--out", str(folder / "steered")],
        standalone_mode=False,
    )  # fmt: skip
    if result.exception is not None:
        raise result.exception
    return read_plan(folder / "steered" / "plan.toml")


def test_the_plan_stays_within_the_rigs_limits_and_moves_as_fast_as_it_may(plan):
    limits = plan.rig.limits
    angles = [stop.settings["axis_angle_deg"] for stop in plan.stops]
    assert all(limits.min_gap_mm <= gap <= limits.max_gap_mm for gap in plan.gaps_mm)
    assert all(-120.0 <= angle <= 120.0 for angle in angles)
    assert min(angles) < 0.0
    for a, b in itertools.pairwise(plan.gaps_mm):
        assert abs(b - a) <= 10.0 + 1e-9
    for a, b in itertools.pairwise(angles):
        assert abs(b - a) <= 20.0 + 1e-9


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_the_true_rod_goes_where_the_nominal_one_was_led(plan, seed):
    bench = LumenBench(
        plan.specimen, plan.rig.magnet.magnet(), lumen_of(plan.lumen_text), seed=seed,
        wall_height_mm=plan.model.lumen.wall_height_mm,
    )  # fmt: skip
    bench.axes = {axis.name: SimpleNamespace(value=None) for axis in plan.rig.axis}
    tips = []
    for stop in plan.stops:
        for name, value in stop.settings.items():
            bench.axes[name].value = value
        tips.append(bench.resting(stop.gap_mm).tip_mm)
    passed = [
        gate.name
        for a, b in itertools.pairwise(tips)
        for gate in bench.lumen.gates
        if crosses(gate, a, b)
    ]
    assert passed == ["right branch"]


def test_what_no_rig_can_do_is_no_plan(plan):
    way = navigate(
        gmc(2), lumen_of(plan.lumen_text), UniformField(flux_mT=1.0), way_mm=3.0,
    )  # fmt: skip
    files = {"name": "a", "specimen_file": "s.toml", "rig_file": "r.toml"}
    start = {"insertion_mm": 0.0, "gap_mm": 60.0}
    turning = tuple(start | {"axis_angle_deg": angle} for angle in (90.0, 70.0))
    with pytest.raises(InputError, match="an axis axis_angle_deg"):
        plan_of(Steered(poses=turning, passage=way), **files)
    rising = (start, {"insertion_mm": 3.0, "gap_mm": 70.0})
    with pytest.raises(InputError, match="gaps that never rise"):
        plan_of(Steered(poses=rising, passage=way), **files)
    with pytest.raises(InputError, match="poses of a uniform field"):
        plan_of(
            Steered(poses=({"insertion_mm": 0.0, "flux_mT": 1.0},), passage=way),
            **files,
        )
