"""Other people's solvers, each given one rod; `bench_peers.py` compares them.

GMC 2 with the dead load at the tip that 50 mT across reduces to (so no peer evaluates a
field), and with its weight across the plane. Lengths come in mm, in go SI units.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import root

from magbend.core.units import GRAVITY_M_PER_S2, MU0

Array = NDArray[np.float64]

PIECE_M, PARTS, SIDE_M = 0.01, 3, 1e-3
LENGTH_M = PARTS * PIECE_M
E_Pa = np.array([20e6, 15e6, 10e6])
AREA_M2 = SIDE_M**2
EI = E_Pa * SIDE_M**4 / 12.0
DENSITY_KG_M3 = 2640.0
LOAD_N = AREA_M2 * 20.07e-3 / MU0 * 50e-3
BEND = LOAD_N * LENGTH_M**2 / EI
STRETCH_N = 15e6 * AREA_M2
REST_S = 0.25
"""Damped at 150 / s, near critically, PyElastica is at rest to 1e-8 by then."""


def marched(
    bend: Array,
    tolerance: float,
    stretch: float = 0.0,
    shear: float = 0.0,
    thinning: float = 0.0,
) -> Array:
    """Return tips of rods under dead loads at the tip, over length, shape (n, 2).

    Shooting from the root: the sections one after another, all rods at once. The
    derivative to the root's moment is carried along (of the stiff rod: the rest is
    small), and Newton's method brings the tip's moment to zero. Moments count in units
    of load times length.

    Parameters
    ----------
    bend : ndarray, shape (PARTS, n)
        Load times length squared over EI, of each section.
    tolerance : float
        Relative and absolute, of the integration.
    stretch, shear : float
        Load over EA and over GA of a rod that gives way.
    thinning : float
        EI falls with this power of the stretch.
    """
    n = bend.shape[1]

    def slope(_s: float, flat: Array, beta: Array) -> Array:
        theta, moment, dtheta, dmoment = flat.reshape(6, n)[:4]
        c, s = np.cos(theta), np.sin(theta)
        soft = 1.0 + (stretch - shear) * s
        curvature = beta * moment * (1.0 + stretch * s) ** thinning
        columns = beta * dmoment, s * dtheta
        return np.concatenate(
            [curvature, -c * soft, *columns, c * soft, s * soft + shear]
        )

    moment = np.ones(n)
    for _ in range(20):
        state = np.zeros((6, n))
        state[1], state[3] = moment, 1.0
        for beta in bend:
            state = solve_ivp(
                slope, (0.0, 1.0 / PARTS), state.ravel(), method="DOP853",
                args=(beta,), rtol=tolerance, atol=tolerance,
            ).y[:, -1].reshape(6, n)  # fmt: skip
        moment = moment - state[1] / state[3]
        if np.abs(state[1]).max() <= tolerance:
            break
    return np.array(state[4:6].T)


def exact(
    stretch_N: float = np.inf, shear_N: float = np.inf, thinning: float = 0.0
) -> Array:
    """Return the tip in the plane, in mm, to twelve digits; EA and GA may give way."""
    soft = LOAD_N / stretch_N, LOAD_N / shear_N
    return 1e3 * LENGTH_M * marched(BEND[:, None], 3e-14, *soft, thinning)[0]


def bvp_in_plane(tolerance: float, *, given: bool = True) -> Array:
    """Return the tip by solve_bvp, the sections side by side, in mm.

    Unknowns theta, moment, x, y of each section, moments in units of `LOAD_N`
    times the length. `given` says whether it is told the Jacobians.
    """
    bend, pull = BEND / PARTS, 1.0 / PARTS

    def slope(_t: Array, y: Array) -> Array:
        theta, moment = y[0:3], y[3:6]
        c, s = np.cos(theta), np.sin(theta)
        return np.vstack([bend[:, None] * moment, -pull * c, pull * c, pull * s])

    def slope_jacobian(_t: Array, y: Array) -> Array:
        out = np.zeros((12, 12, y.shape[1]))
        c, s = np.cos(y[0:3]), np.sin(y[0:3])
        at = np.arange(3)
        out[at, 3 + at] = bend[:, None]
        out[3 + at, at] = pull * s
        out[6 + at, at] = -pull * s
        out[9 + at, at] = pull * c
        return out

    joints = [i for i in range(12) if i % 3 != 2]

    def ends(a: Array, b: Array) -> Array:
        return np.array([a[0], a[6], a[9], b[5], *(b[i] - a[i + 1] for i in joints)])

    at_root, at_tip = np.zeros((12, 12)), np.zeros((12, 12))
    at_root[[0, 1, 2], [0, 6, 9]] = 1.0
    at_tip[3, 5] = 1.0
    for row, i in enumerate(joints, start=4):
        at_root[row, i + 1], at_tip[row, i] = -1.0, 1.0

    found = solve_bvp(
        slope, ends, np.linspace(0.0, 1.0, 6), np.zeros((12, 6)), tol=tolerance,
        fun_jac=slope_jacobian if given else None,
        bc_jac=(lambda _a, _b: (at_root, at_tip)) if given else None,
    )  # fmt: skip
    return 1e3 * LENGTH_M * np.array([found.y[8, -1], found.y[11, -1]])


def cables(elements: int, *, weight: bool) -> Callable[[], Array]:
    """Return a function that solves a system of exudyn anew, and gives the tip in mm.

    Only the solve is inside it: the system is set up beforehand.
    """
    import exudyn as exu
    from exudyn import itemInterface as parts

    mbs = exu.SystemContainer().AddSystem()
    cable = parts.ObjectANCFCable if weight else parts.ObjectANCFCable2D
    node = parts.NodePointSlope1 if weight else parts.NodePoint2DSlope1
    straight = np.array([0.0, 0, 0, 1, 0, 0] if weight else [0.0, 0, 1, 0])
    size_m = LENGTH_M / elements
    places = np.tile(straight, (elements + 1, 1))
    places[:, 0] = size_m * np.arange(elements + 1)
    nodes = [mbs.AddNode(node(referenceCoordinates=list(at))) for at in places]
    for i, pair in enumerate(pairwise(nodes)):
        body = mbs.AddObject(
            cable(
                length=size_m, massPerLength=DENSITY_KG_M3 * AREA_M2,
                axialStiffness=STRETCH_N, bendingStiffness=EI[PARTS * i // elements],
                nodeNumbers=list(pair),
            )
        )  # fmt: skip
        if weight:
            mass = mbs.AddMarker(parts.MarkerBodyMass(bodyNumber=body))
            fall = [0, 0, -GRAVITY_M_PER_S2]
            mbs.AddLoad(parts.Gravity(markerNumber=mass, loadVector=fall))
    ground = mbs.AddNode(parts.NodePointGround())
    fixed = mbs.AddMarker(parts.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    for i in np.flatnonzero(straight == 0.0).tolist():  # all but the slope's length
        own = mbs.AddMarker(
            parts.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=i)
        )
        mbs.AddObject(parts.CoordinateConstraint(markerNumbers=[fixed, own]))
    tip = mbs.AddMarker(parts.MarkerNodePosition(nodeNumber=nodes[-1]))
    mbs.AddLoad(parts.Force(markerNumber=tip, loadVector=[0, LOAD_N, 0]))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.staticSolver.verboseMode = 0
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    rest = np.zeros_like(mbs.systemData.GetODE2Coordinates())

    def call() -> Array:
        mbs.systemData.SetODE2Coordinates(rest)
        mbs.SolveStatic(settings)
        place = mbs.GetNodeOutput(nodes[-1], exu.OutputVariableType.Position)
        return 1e3 * np.array(place)[: 3 if weight else 2]

    return call


def at_rest(elements: int) -> tuple[Array, Array]:
    """Return where PyElastica comes to rest, in mm, and where its rod should."""
    import elastica as ea

    class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
        pass

    system = Simulator()
    rod = ea.CosseratRod.straight_rod(
        elements, np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), LENGTH_M,
        np.sqrt(AREA_M2 / np.pi), DENSITY_KG_M3, youngs_modulus=15e6, shear_modulus=5e6,
    )  # fmt: skip
    # Its round rod made square; at a joint the mean of the compliances.
    nodes = np.arange(1, elements)
    each = [EI[(PARTS * nodes - side) // elements] for side in (1, 0)]
    wanted = 2.0 / (1.0 / each[0] + 1.0 / each[1])
    rod.bend_matrix *= wanted / rod.bend_matrix[0, 0, 0]
    system.append(rod)
    system.constrain(rod).using(
        ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
    )
    system.add_forcing_to(rod).using(
        ea.EndpointForces, np.zeros(3), np.array([0, LOAD_N, 0.0]), ramp_up_time=1e-3
    )
    step = 1e-4 / max(elements, 12)  # or it blows up
    system.dampen(rod).using(
        ea.AnalyticalLinearDamper, uniform_damping_constant=150.0, time_step=step
    )
    system.finalize()
    stepper, clock = ea.PositionVerlet(), np.float64(0.0)
    for _ in range(int(REST_S / step)):
        clock = stepper.step(system, clock, step)
    # It divides moments by the cube of the stretch: a rod that keeps its volume.
    stretch, shear = rod.shear_matrix[2, 2, 0], rod.shear_matrix[0, 0, 0]
    return 1e3 * rod.position_collection[:2, -1], exact(stretch, shear, 3.0)


def shot_in_space(tolerance: float, stretch: float = 0.0) -> Array:
    """Return the tip under its weight too, in mm, by shooting with scipy's `root`.

    The rod is as stiff in all directions and untwisted, so its tangent t and moment m
    tell all: t' = m x t / EI, m' = n x t, with the force n = load + weight beyond.
    """
    weight = DENSITY_KG_M3 * AREA_M2 * GRAVITY_M_PER_S2 * LENGTH_M / LOAD_N

    def slope(s: float, y: Array, beta: float) -> Array:
        t, m = y[0:3], y[3:6]
        n = np.array([0.0, 1.0, -weight * (1.0 - s)])
        r = t * (1.0 + stretch * (n @ t))
        return np.concatenate([beta * np.cross(m, t), np.cross(n, r), r])

    def end(moment: Array) -> Array:
        y = np.array([1.0, 0.0, 0.0, *moment, 0.0, 0.0, 0.0])
        for i, beta in enumerate(BEND):
            y = solve_ivp(
                slope, (i / PARTS, (i + 1) / PARTS), y, method="DOP853",
                args=(beta,), rtol=tolerance, atol=tolerance,
            ).y[:, -1]  # fmt: skip
        return np.array(y)

    found = root(lambda at: end(at)[3:6], [0.0, weight / 2.0, 1.0], tol=tolerance)
    return 1e3 * LENGTH_M * end(found.x)[6:9]
