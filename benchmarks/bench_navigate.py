"""What a step through a lumen costs, and how the error falls with the elements.

python benchmarks/bench_navigate.py

CPU time of one thread for a whole passage over its steps, Python and all; batches on
all cores as a ratio to one thread in the same run. The error is the distance of the
last tip, which lies along a wall, from the one on 192 elements. With PyElastica (extra
`dev`) a heavy rod is let down on a floor by both: its dynamics at rest, on 20 and 40
elements.
"""

from __future__ import annotations

import contextlib
import io
import math
import sys
import time
from pathlib import Path

import numpy as np

from magbend.core.specimen import Section, Specimen
from magbend.sim import Support, UniformField, gmc
from magbend.sim.navigate import Lumen, Wall, channel, navigate, navigate_many, polyline

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from does_grading_help import NOTHING, lumens

ROD = gmc(2)


def cost_ms(task: str, friction: float) -> float:
    """Return the CPU time of a step, in ms."""
    lumen = lumens(ROD.side_mm)[task]
    best = math.inf
    for _ in range(3):
        start = time.process_time()
        way = navigate(ROD, lumen, NOTHING, friction=friction, refine=False)
        best = min(best, (time.process_time() - start) / len(way.steps))
    return 1e3 * best


LENGTH_MM, DROP_MM, E_MPa, DENSITY = 40.0, 3.0, 1.0, 2640.0
"""A round rod of 1 mm that hangs from its clamp down to a floor, and lies on it."""
AT_MM = np.arange(0.0, 41.0, 4.0)


def ours() -> tuple[np.ndarray, float]:
    """Return the heights of the rod on the floor in mm, and the CPU time in s."""
    rod = Specimen(
        name="round", shape="round", diameter_mm=1.0, remanence_mT=0.0,
        density_kg_m3=DENSITY, sections=(Section(length_mm=LENGTH_MM, E_MPa=E_MPa),),
    )  # fmt: skip
    under = polyline([(-5.0, -DROP_MM - 0.5), (60.0, -DROP_MM - 0.5)])
    floor = Lumen(name="floor", walls=(Wall("floor", under),), inside_mm=(1.0, 0.0))
    down = Support(gravity_m_s2=(0.0, -9.80665, 0.0))
    start = time.process_time()
    way = navigate(rod, floor, NOTHING, support=down, step_mm=2.0, refine=False)
    last = way.steps[-1]
    cost = time.process_time() - start
    return np.interp(AT_MM, last.s_mm, last.shape[1]), cost


def pyelastica(elements: int) -> tuple[np.ndarray, float]:
    """Return the same of PyElastica's Cosserat rod, damped until it is at rest.

    Its clamp holds the middle of the first element, so that it begins half an element
    behind; its floor takes hold a micrometre above, not the tenth of a millimetre that
    it has by default, which would carry a rod that does not touch.
    """
    import elastica as ea

    class Thin(ea.RodPlaneContact):
        def __init__(self, **given: float) -> None:
            super().__init__(**given)
            self.surface_tol = 1e-6

    class Simulator(
        ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Contact, ea.Damping
    ):
        pass

    length, young = 1e-3 * LENGTH_MM, 1e6 * E_MPa
    piece = length / (elements - 0.5)
    along, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    system = Simulator()
    rod = ea.CosseratRod.straight_rod(
        elements, -0.5 * piece * along, along, up, elements * piece, 5e-4, DENSITY,
        youngs_modulus=young, shear_modulus=young / 3.0,
    )  # fmt: skip
    floor = ea.Plane(plane_origin=-(1e-3 * DROP_MM + 5e-4) * up, plane_normal=up)
    system.append(rod)
    system.append(floor)
    held = {"constrained_position_idx": (0,), "constrained_director_idx": (0,)}
    system.constrain(rod).using(ea.OneEndFixedBC, **held)
    system.add_forcing_to(rod).using(ea.GravityForces, acc_gravity=-9.80665 * up)
    system.detect_contact_between(rod, floor).using(Thin, k=20.0, nu=2e-3)
    step = 0.2 * piece / math.sqrt(young / DENSITY)
    system.dampen(rod).using(
        ea.AnalyticalLinearDamper, uniform_damping_constant=20.0, time_step=step
    )
    system.finalize()
    start = time.process_time()
    with contextlib.redirect_stdout(io.StringIO()):
        ea.integrate(
            ea.PositionVerlet(), system, 4.0, int(4.0 / step), progress_bar=False
        )
    x, y = 1e3 * rod.position_collection[:2]
    s = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(y)))) - 500.0 * piece
    return np.interp(AT_MM, s, y), time.process_time() - start


def beside_pyelastica() -> None:
    """Print how far both are apart on the floor, and what they cost."""
    here, cost = ours()
    here, cost = ours()  # warm
    (coarse, _), (fine, theirs) = pyelastica(20), pyelastica(40)
    for elements, line in ((20, coarse), (40, fine)):
        off_um = 1e3 * np.abs(line - here).max()
        print(f"PyElastica, {elements} elements: heights off by {off_um:.1f} um")
    print(f"CPU: {cost:.3f} s, PyElastica on 40 elements {theirs:.1f} s")


def main() -> None:
    for task in ("45 degrees", "90 degrees", "S", "fork"):
        plain, rubbed = cost_ms(task, 0.0), cost_ms(task, 0.2)
        print(f"{task:12s} {plain:6.2f} ms a step, {rubbed:6.2f} with friction (CPU)")
    bend = channel("bend", width_mm=2.5, legs=[(5.0, 0.0), (12.0, 60.0), (20.0, 0.0)])
    field = UniformField(flux_mT=20.0)
    tips = {
        n: navigate(ROD, bend, field, elements=n, refine=False).steps[-1].tip_mm
        for n in (6, 12, 24, 48, 96, 192)
    }
    for n in (6, 12, 24, 48, 96):
        print(f"{n:4d} elements: tip off by {math.dist(tips[n], tips[192]):.1e} mm")
    rods = [gmc(1 + n % 7) for n in range(28)]
    walls = []
    for threads in (1, None):
        start = time.perf_counter()
        navigate_many(rods, bend, field, threads=threads)
        walls.append(time.perf_counter() - start)
    print(f"28 rods on all cores: {walls[0] / walls[1]:.2f} times as fast as on one")
    try:
        beside_pyelastica()
    except ImportError:
        print("PyElastica is not installed: pip install 'magbend[dev]'")


if __name__ == "__main__":
    main()
