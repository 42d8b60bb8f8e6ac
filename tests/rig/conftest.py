"""A bench of the simplest devices: what the runner is tested on without firmware."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from magbend.rig.bench.config import Plan, read_plan
from magbend.rig.bench.devices import Devices
from magbend.rig.clock import SteppedClock
from magbend.rig.stage.gap import GapStage
from magbend.rig.stage.place import PlaceMap
from magbend.rig.stage.protocol import StageIdentity, StageLimits, StageStatus
from magbend.rig.stage.stopping import StopProof
from magbend.rig.virtual.camera import VirtualCamera
from magbend.rig.virtual.meter import VirtualMeter

RIG = """
name = "test bench"
[stage]
port = "none"
gap_at_zero_mm = 150.0
direction = 1
feed_mm_min = 300.0
[limits]
min_gap_mm = 40.0
max_gap_mm = 149.0
[camera]
backend = "twin"
[meter]
driver = "twin"
[magnet]
side_mm = 55.0
remanence_T = 1.305
"""

SPECIMEN = """
name = "GMC 2"
side_mm = 1.0
remanence_mT = 20.07
[[section]]
length_mm = 10.0
E_MPa = 20.0
[[section]]
length_mm = 10.0
E_MPa = 10.0
"""

PLAN = """
name = "gmc2"
operator = "A. Tester"
specimen = "specimen.toml"
rig = "rig.toml"
gaps_mm = [70.0, 60.0, 50.0]
[settle]
time_s = 0.5
image_change_percent = 0.05
frames = 3
timeout_s = 20.0
"""


@dataclass
class FakeStage:
    """A raw stage that arrives; `before` lets a test interfere with any call."""

    clock: SteppedClock
    machine_mm: float = -50.0
    position_state: str = "unknown"
    is_stop_asked: bool = False
    calls: list[str] = field(default_factory=list)
    before: Callable[[str], None] = lambda call: None
    limits: StageLimits = field(
        default_factory=lambda: StageLimits(
            step_mm=0.004,
            max_feed_mm_min=500.0,
            acceleration_mm_s2=10.0,
            travel_mm=(-199.0, -1.0),
        )
    )
    identity: StageIdentity = field(
        default_factory=lambda: StageIdentity(
            driver="fake", firmware="0", port="none", settings={"$100": "250.000"}
        )
    )

    def _log(self, call: str) -> None:
        self.calls.append(call)
        self.before(call)

    def connect(self) -> None:
        self._log("connect")

    def home(self) -> None:
        self._log("home")
        self.machine_mm = -1.0
        self.position_state = "homed"

    zero_mm: float = 150.0
    doubt: str = "the position of the stage is not known; home it first"

    @property
    def place_map(self) -> PlaceMap:
        return PlaceMap(
            gap_at_zero_mm=self.zero_mm,
            direction=1,
            axis="X",
            step_mm=self.limits.step_mm,
            travel_mm=self.limits.travel_mm,
            firmware="0",
            settings=self.identity.settings,
        )

    def assume_homed(
        self, machine_mm: float, map_: tuple[float, int], *, for_run: bool = False
    ) -> None:
        del for_run
        self.machine_mm, self.zero_mm = machine_mm, map_[0]
        self.position_state = "homed"

    def move_to(
        self,
        machine_mm: float,
        *,
        feed_mm_min: float,
        moved: Callable[[float], None] = lambda machine_mm: None,
    ) -> None:
        self._log(f"move {machine_mm:g}")
        self.clock.sleep(abs(machine_mm - self.machine_mm) / feed_mm_min * 60.0)
        moved(self.machine_mm)
        self.machine_mm = machine_mm

    def status(self) -> StageStatus:
        return StageStatus(
            state="idle",
            machine_mm=self.machine_mm,
            position_state=self.position_state,
        )

    def listen(self) -> None:
        pass

    def stop_requested(self) -> bool:
        return self.is_stop_asked

    def request_stop(self) -> None:
        self.is_stop_asked = True

    last_stop: StopProof = field(default_factory=lambda: StopProof(means="nothing"))

    def hold(self) -> StopProof:
        self._log("hold")
        return self.last_stop

    def stop(self) -> StopProof:
        self._log("stop")
        return self.last_stop

    def recover(self) -> None:
        self._log("recover")

    def unlock(self) -> None:
        self._log("unlock")

    def close(self) -> None:
        self._log("close")


def render(gap_mm: float, time_s: float) -> np.ndarray:
    """A dark bar on paper whose place depends on the gap, with noise that changes."""
    generator = np.random.default_rng(int(time_s * 1e3))
    image = np.full((96, 128), 210.0) + generator.normal(0.0, 1.5, (96, 128))
    middle = gap_mm - 20.0
    rows = np.arange(96)[:, None]
    cover = np.clip(4.5 - np.abs(rows - middle), 0.0, 1.0)
    image[:, 20:110] -= 170.0 * cover
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


@dataclass
class Bench:
    """Devices of one test, with the parts at hand."""

    plan: Plan
    devices: Devices
    raw: FakeStage
    camera: VirtualCamera
    meter: VirtualMeter
    clock: SteppedClock


@pytest.fixture
def plan_file(tmp_path: Path) -> Path:
    """Return the path of a valid plan with its rig and specimen beside it."""
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "specimen.toml").write_text(SPECIMEN)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path / "plan.toml"


@pytest.fixture
def make_bench(plan_file: Path) -> Callable[..., Bench]:
    """Return a maker of benches; camera and meter options go by prefix."""

    def make(
        *, camera: dict | None = None, meter: dict | None = None, seed: int = 1
    ) -> Bench:
        plan = read_plan(plan_file)
        clock = SteppedClock()
        raw = FakeStage(clock)
        stage = GapStage(raw, plan.rig.stage, plan.rig.limits, clock)
        stage.connect()

        def gap() -> float:
            return stage.to_gap_mm(raw.machine_mm)

        eye = VirtualCamera(render, gap, clock, **(camera or {}))
        probe = VirtualMeter(
            lambda gap_mm: 38.0 * (70.0 / gap_mm) ** 2,
            gap,
            random.Random(seed),
            **(meter or {}),
        )
        devices = Devices(stage=stage, camera=eye, meter=probe, clock=clock)
        return Bench(plan, devices, raw, eye, probe, clock)

    return make


@pytest.fixture
def bench(make_bench: Callable[..., Bench]) -> Bench:
    """Return a bench on which nothing goes wrong."""
    return make_bench()
