"""Exact derivatives of the shape with respect to every parameter of the experiment.

The unknowns u of the march satisfy R(u, p) = 0 at the clamp, so du/dp = -R_u^-1 R_p
(implicit function theorem). R_p and what it does to the shape come from one more column
of the same Taylor march per parameter: no differences, no step to choose.

A parameter enters the kernel as the derivative of the rod array (n, 5), of the field
and of the clamp angle. The field's is (bx, by, scale, cx, cy, omega): at a fixed point

    dB = (bx, by) + scale B - G c + omega (J B - G J (r - centre))

for a change of its value, a factor, a shift c of the magnet and a turn omega of it
about its own centre, where G is the gradient and J turns by 90 degrees.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arrays import real_array
from ..core.checks import finite, listed, shown
from ..core.errors import InputError, SolverError
from ..core.jit import njit
from ..core.specimen import Specimen
from ..core.units import MU0, rad_from_deg
from .fields import Field, MagnetField, Solution, Support, UniformField, check_case
from .planar import ORDER, STEP, solve_planar
from .planar_follow import solve3
from .planar_march import (
    PART,
    STATE,
    WX,
    WY,
    E,
    H,
    M,
    add_load,
    advance,
    begin,
    column_step,
    enter_section,
    field_at,
    series,
    substeps,
)
from .scaling import (
    checked_density,
    field_array,
    rod_array,
    stations,
    stiffness_Nmm2,
)
from .solve import NO_SUPPORT, solve

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivities:
    """Derivatives of a shape at fixed arc lengths from the clamp.

    Parameters
    ----------
    solution : Solution
        The equilibrium.
    s_mm : ndarray, shape (n,)
        Where.
    parameters : tuple of str
        With respect to what; the unit is the one in the name.
    dx_mm, dy_mm, dtheta_rad : ndarray, shape (n, p)
        Derivatives of x, y and the tangent angle, per unit of each parameter.
    """

    solution: Solution
    s_mm: Array
    parameters: tuple[str, ...]
    dx_mm: Array
    dy_mm: Array
    dtheta_rad: Array


@njit(**PART)
def _field_change(field, change, x, y, b):  # type: ignore[no-untyped-def]
    """Return dB of one parameter at a fixed point (module docstring)."""
    fx = change[0] + change[2] * b[0] - b[2] * change[3] - b[3] * change[4]
    fy = change[1] + change[2] * b[1] - b[3] * change[3] - b[4] * change[4]
    if change[5] != 0.0:
        dx = x - field[4]
        dy = y - field[5]
        fx += change[5] * (-b[1] + b[2] * dy - b[3] * dx)
        fy += change[5] * (b[0] + b[3] * dy - b[4] * dx)
    return fx, fy


@njit(**PART)
def _load_columns(field, m, dm, changes, x, y, cf, sf, D):  # type: ignore[no-untyped-def]
    """Add to all columns the change of the load m B(r) of the point (x, y)."""
    b = field_at(field, x, y)
    for n in range(D.shape[0]):
        for a in range(4):
            dx = cf * D[n, 2, a] - sf * D[n, 3, a]
            dy = sf * D[n, 2, a] + cf * D[n, 3, a]
            bx, by = _field_change(field, changes[n, a], x, y, b)
            bx += b[2] * dx + b[3] * dy
            by += b[3] * dx + b[4] * dy
            fx = m * bx + dm[n, a] * b[0]
            fy = m * by + dm[n, a] * b[1]
            D[n, 4, a] += cf * fx + sf * fy
            D[n, 5, a] += cf * fy - sf * fx


@njit(**PART)
def _enter_columns(rows, cf, sf, D):  # type: ignore[no-untyped-def]
    """Set the changes of what acts within a section, whose rod rows are `rows`."""
    for n in range(D.shape[0]):
        for a in range(4):
            wx = rows[n, a, WX]
            wy = rows[n, a, WY]
            D[n, 6, a] = rows[n, a, E]
            D[n, 7, a] = cf * wx + sf * wy
            D[n, 8, a] = cf * wy - sf * wx


@njit(**PART)
def _end_section(rows, X, D):  # type: ignore[no-untyped-def]
    """Move the end of a section, for parameters that change its length."""
    sine = math.sin(X[0])
    cosine = math.cos(X[0])
    for n in range(D.shape[0]):
        for a in range(4):
            dh = rows[n, a, H]
            D[n, 0, a] += dh * X[6] * X[1]
            D[n, 1, a] += dh * (X[4] * sine - X[5] * cosine)
            D[n, 2, a] -= dh * cosine
            D[n, 3, a] -= dh * sine
            D[n, 4, a] += dh * X[7]
            D[n, 5, a] += dh * X[8]


@njit(**PART)
def _integrate(h, order, C):  # type: ignore[no-untyped-def]
    """Turn the products with cos and sin into series of the positions, over tau / h."""
    for n in range(C.shape[0]):
        for k in range(order):
            f = h / (k + 1)
            for a in range(4):
                C[n, k, 2, a] *= f
                C[n, k, 3, a] *= f


@njit(**PART)
def _station_columns(r, h, order, before, grow, T, C, out):  # type: ignore[no-untyped-def]
    """Evaluate the columns at the fraction `r` of a step of length `h`.

    `before` holds their positions where the step begins, and the products in C are
    integrated (`_integrate`). `grow` holds how far the station slides along the
    section, as its distance from the clamp is kept while lengths change.
    """
    slope = sine = cosine = 0.0
    for k in range(order - 1, -1, -1):
        slope = slope * r + (k + 1) * T[0, k + 1]
        sine = sine * r + T[2, k]
        cosine = cosine * r + T[3, k]
    for n in range(C.shape[0]):
        for a in range(4):
            theta = C[n, order, 0, a]
            x = y = 0.0
            for k in range(order - 1, -1, -1):
                theta = theta * r + C[n, k, 0, a]
                x = x * r + C[n, k, 3, a]
                y = y * r + C[n, k, 2, a]
            c = 4 * n + a
            out[0, c] = theta + grow[n, a] * slope / h
            out[1, c] = before[n, 0, a] - r * x - grow[n, a] * cosine
            out[2, c] = before[n, 1, a] - r * y - grow[n, a] * sine


@njit(**PART)
def _combine(D, clamps, cf, sf, out):  # type: ignore[no-untyped-def]
    """Close the columns at the clamp: subtract what the unknowns must make up for.

    Return False if the Newton matrix is singular.
    """
    d = np.empty(3)
    for c in range(3, out.shape[2]):
        n = c // 4
        a = c % 4
        miss = D[n, 0, a] - clamps[n, a]
        if not solve3(D[0], miss, D[n, 2, a], D[n, 3, a], d):
            return False
        for k in range(out.shape[0]):
            for i in range(3):
                for j in range(3):
                    out[k, i, c] += out[k, i, j] * d[j]
            x = out[k, 1, c]
            y = out[k, 2, c]
            out[k, 1, c] = cf * x - sf * y
            out[k, 2, c] = sf * x + cf * y
    return True


@njit(cache=True, error_model="numpy")
def _columns(rod, field, u, rods, changes, clamps, s, order, step, out):  # type: ignore[no-untyped-def]
    """March with a column for each unknown and parameter; return whether it went well.

    Parameters
    ----------
    rod, field, u
        The case and the unknowns (gamma, x_L, y_L, phi) of its equilibrium.
    rods : ndarray, shape (sections, b, 4, 5)
        Derivatives of the rod's rows with respect to parameters, in b blocks of four;
        the first three columns, those of the unknowns, are zero.
    changes, clamps : ndarray, shapes (b, 4, 6), (b, 4)
        The same of the field (module docstring) and of the clamp angle.
    s : ndarray, shape (n,)
        Stations.
    order, step
        As of `planar_march.march`.
    out : ndarray, shape (n, 3, 4 b)
        Receives the derivatives of theta, x and y.
    """
    blocks = clamps.shape[0]
    X = np.empty(STATE)
    D = np.zeros((blocks, STATE, 4))
    T = np.empty((4, order + 1))
    C = np.empty((blocks, order + 1, 4, 4))
    before = np.empty((blocks, 2, 4))
    grow = np.zeros((blocks, 4))
    dm = np.empty((blocks, 4))
    for i in range(rod.shape[0]):
        for n in range(blocks):
            for a in range(4):
                grow[n, a] += rods[i, n, a, H]
    begin(u, 0, X, D[0])
    D[0, 0, 0] = 1.0
    k = s.shape[0] - 1
    reached = 0.0
    for i in range(rod.shape[0]):
        m = rod[i, M] - rod[i - 1, M] if i > 0 else rod[i, M]
        for n in range(blocks):
            for a in range(4):
                dm[n, a] = rods[i, n, a, M]
                if i > 0:
                    dm[n, a] -= rods[i - 1, n, a, M]
        add_load(rod, field, i, 1.0, u, 0, X, D[0])
        cf = math.cos(u[3])
        sf = math.sin(u[3])
        if i == 0:
            D[0, 2, 1] = D[0, 3, 2] = cf
            D[0, 3, 1] = -sf
            D[0, 2, 2] = sf
        x = u[1] + cf * X[2] - sf * X[3]
        y = u[2] + sf * X[2] + cf * X[3]
        _load_columns(field, m, dm, changes, x, y, cf, sf, D)
        enter_section(rod, i, 1.0, u, 0, X, D[0])
        _enter_columns(rods[i], cf, sf, D)
        count = substeps(rod[i, H], X, step)
        h = rod[i, H] / count
        for j in range(count):
            series(h, order, X, T)
            for n in range(blocks):
                for a in range(4):
                    before[n, 0, a] = D[n, 2, a]
                    before[n, 1, a] = D[n, 3, a]
                column_step(h, order, X, T, D[n], C[n])
            _integrate(h, order, C)
            last = i + 1 == rod.shape[0] and j + 1 == count
            while k >= 0 and (last or 1.0 - s[k] <= reached + h + 1e-13):
                r = (1.0 - s[k] - reached) / h
                _station_columns(r, h, order, before, grow, T, C, out[k])
                k -= 1
            advance(h, order, X, T)
            reached += h
        _end_section(rods[i], X, D)
        for n in range(blocks):
            for a in range(4):
                grow[n, a] -= rods[i, n, a, H]
    return _combine(D, clamps, cf, sf, out)


def sensitivities(
    specimen: Specimen,
    field: Field,
    *,
    parameters: Sequence[str],
    support: Support = NO_SUPPORT,
    s_mm: ArrayLike | None = None,
) -> Sensitivities:
    """Return the derivatives of the equilibrium shape (plain rod, in the plane).

    Parameters
    ----------
    specimen, field, support
        As for `solve`.
    parameters : sequence of str
        Of ``E_MPa[i]``, ``length_mm[i]``, ``side_mm[i]``, ``remanence_mT[i]`` (section
        i, 0 at the root), ``side_mm``, ``remanence_mT`` (all sections together),
        ``flux_mT``, ``angle_deg``, ``gap_mm``, ``magnet.remanence_T``,
        ``magnet.axis_angle_deg``, ``magnet.offset_mm[0|1|2]``, ``clamp_angle_deg``,
        ``load_factor``, ``gravity_m_s2[0|1]``, ``density_kg_m3``.
    s_mm : array_like, shape (n,), optional
        Increasing arc lengths from the clamp; 61 equally spaced ones by default.

    Returns
    -------
    Sensitivities
        At arc lengths that stay fixed: where a length changes, the tip moves on from
        s = L by its tangent besides. The undeformed tip, from which the gap counts,
        moves with it.

    Raises
    ------
    InputError
        If a parameter is unknown or has no meaning for this field, an arc length lies
        outside the rod, or the case is not planar.
    SolverError
        If there is no equilibrium, or it stands at a fold.
    """
    check_case(specimen, field, support)
    names = _names(parameters)
    if not (support.in_plane and (isinstance(field, UniformField) or field.in_plane)):
        raise InputError(
            "gravity_m_s2[2] in m/s2, magnet elevation_deg and offset_mm[2] must be 0 "
            "for sensitivities, which are planar; instead received one that is not"
        )
    solution = solve(specimen, field, support=support)
    if solution.centreline is None:
        raise SolverError(
            f"{specimen.name!r} has no equilibrium at this load, so its shape has no "
            f"derivatives; the branch ends at {solution.load_limit:.4g} of the load"
        )
    s = _stations(s_mm, specimen.length_mm)
    rod = rod_array(specimen, support)
    array = field_array(field, specimen.length_mm)
    clamp = rad_from_deg(support.clamp_angle_deg)
    u = solve_planar(rod, array, clamp, 0.0, stations(2), ORDER, STEP)[-1]
    records = [_record(name, specimen, field, support) for name in names]
    good, out = _derivatives(rod, array, u, records, s / specimen.length_mm)
    if not good or not np.all(np.isfinite(out)):
        raise SolverError(
            f"{specimen.name!r} stands at a fold of its equilibria: its shape has no "
            "derivatives at this load"
        )
    return Sensitivities(
        solution=solution,
        s_mm=s,
        parameters=names,
        dx_mm=out[:, 1] * specimen.length_mm,
        dy_mm=out[:, 2] * specimen.length_mm,
        dtheta_rad=out[:, 0].copy(),
    )


def _derivatives(
    rod: Array, field: Array, u: Array, records: Sequence[_Record], s: Array
) -> tuple[bool, Array]:
    """Return theta, x and y by parameter, shape (n, 3, p), and whether they exist."""
    blocks = (3 + len(records) + 3) // 4
    rods = np.zeros((len(rod), blocks, 4, rod.shape[1]))
    changes = np.zeros((blocks, 4, 6))
    clamps = np.zeros((blocks, 4))
    for column, record in enumerate(records, start=3):
        n, a = divmod(column, 4)
        rods[:, n, a] = record.rod
        changes[n, a] = record.field
        clamps[n, a] = record.clamp
    out = np.empty((len(s), 3, 4 * blocks))
    good = _columns(rod, field, u, rods, changes, clamps, s, ORDER + 4, STEP, out)
    return good, out[:, :, 3 : 3 + len(records)]


def _names(parameters: Sequence[str]) -> tuple[str, ...]:
    names = listed(parameters)
    if names is None or not all(isinstance(name, str) for name in names):
        raise InputError(
            "parameters must be a sequence of names such as ['E_MPa[0]', 'side_mm']; "
            f"instead received {shown(parameters)}"
        )
    return names


def _stations(s_mm: ArrayLike | None, length_mm: float) -> Array:
    if s_mm is None:
        return stations(61) * length_mm
    s = real_array(s_mm, "s_mm", "mm")
    if (
        s.ndim != 1
        or len(s) == 0
        or np.any(np.diff(s) < 0.0)
        or s[0] < 0.0
        or s[-1] > length_mm * (1.0 + 1e-12)
    ):
        raise InputError(
            f"s_mm must be arc lengths from 0 to {length_mm:g} mm that do not fall; "
            f"instead received an array of shape {s.shape}"
        )
    return s


@dataclass(slots=True, kw_only=True)
class _Record:
    """Derivative of the kernel's input with respect to one parameter."""

    rod: Array
    field: Array
    clamp: float = 0.0


def _record(name: str, specimen: Specimen, field: Field, support: Support) -> _Record:
    record = _Record(rod=np.zeros((len(specimen.sections), 5)), field=np.zeros(6))
    match = re.fullmatch(r"([\w.]+?)(?:\[(\d+)\])?", name)
    key = match.group(1) if match else name
    index = int(match.group(2)) if match and match.group(2) is not None else None
    if key in _OF_SECTIONS and (
        index is not None or key in ("side_mm", "remanence_mT")
    ):
        chosen = range(len(specimen.sections)) if index is None else [index]
        if index is not None and index >= len(specimen.sections):
            raise InputError(
                f"parameter {name} must name one of {len(specimen.sections)} sections, "
                f"counted from 0 at the root; instead received {index}"
            )
        for i in chosen:
            _OF_SECTIONS[key](record, i, specimen, field, support)
    elif key == "clamp_angle_deg" and index is None:
        record.clamp = rad_from_deg(1.0)
    elif key in ("load_factor", "density_kg_m3", "gravity_m_s2"):
        _of_loads(record, key, index, name, specimen, support)
    else:
        _of_field(record, key, index, name, specimen, field)
    return record


def _unit_rows(specimen: Specimen, support: Support) -> tuple[Array, Array]:
    """Return m per mT of remanence (load factor 1) and weight per (kg/m3 m/s2)."""
    length_mm = specimen.length_mm
    per_N = length_mm**2 / stiffness_Nmm2(specimen)[0]
    area = np.array(specimen.sides_mm)[::-1] ** 2
    return area * 1e-9 / MU0 * per_N, area * length_mm * 1e-9 * per_N


def _of_E(
    record: _Record, i: int, specimen: Specimen, field: Field, support: Support
) -> None:
    rod = rod_array(specimen, support)
    record.rod[-1 - i, E] -= rod[-1 - i, E] / specimen.sections[i].E_MPa


def _of_side(
    record: _Record, i: int, specimen: Specimen, field: Field, support: Support
) -> None:
    row = rod_array(specimen, support)[-1 - i]
    powers = np.array([0.0, -4.0, 2.0, 2.0, 2.0])
    record.rod[-1 - i] += powers * row / specimen.sides_mm[i]


def _of_remanence(
    record: _Record, i: int, specimen: Specimen, field: Field, support: Support
) -> None:
    per_mT, _ = _unit_rows(specimen, support)
    record.rod[-1 - i, M] += support.load_factor * per_mT[-1 - i]


def _of_length(
    record: _Record, i: int, specimen: Specimen, field: Field, support: Support
) -> None:
    record.rod[-1 - i, H] += 1.0 / specimen.length_mm
    if isinstance(field, MagnetField):
        record.field[3] += 1.0 / specimen.length_mm


_OF_ALL = ("side_mm", "remanence_mT")
_OF_SECTIONS: dict[str, Callable[[_Record, int, Specimen, Field, Support], None]] = {
    "E_MPa": _of_E,
    "side_mm": _of_side,
    "remanence_mT": _of_remanence,
    "length_mm": _of_length,
}


def _of_loads(
    record: _Record,
    key: str,
    index: int | None,
    name: str,
    specimen: Specimen,
    support: Support,
) -> None:
    per_mT, per_weight = _unit_rows(specimen, support)
    if key == "load_factor" and index is None:
        record.rod[:, M] = per_mT * np.array(specimen.remanences_mT)[::-1]
    elif key == "density_kg_m3" and index is None:
        gx, gy, _ = support.gravity_m_s2
        record.rod[:, WX] = per_weight * gx
        record.rod[:, WY] = per_weight * gy
    elif key == "gravity_m_s2" and index in (0, 1):
        density = specimen.density_kg_m3 or checked_density(
            specimen, Support(gravity_m_s2=(1.0, 0.0, 0.0))
        )
        record.rod[:, WX if index == 0 else WY] = per_weight * density
    else:
        raise _unknown(name)


def _of_field(
    record: _Record,
    key: str,
    index: int | None,
    name: str,
    specimen: Specimen,
    field: Field,
) -> None:
    scale = 1.0 / specimen.length_mm
    if isinstance(field, UniformField) and index is None:
        unit = field_array(
            UniformField(flux_mT=1.0, angle_deg=field.angle_deg), specimen.length_mm
        )
        if key == "flux_mT":
            record.field[:2] = unit[1:3]
            return
        if key == "angle_deg":
            turn = finite(field.flux_mT, "flux_mT", "mT") * rad_from_deg(1.0)
            record.field[:2] = -unit[2] * turn, unit[1] * turn
            return
    if isinstance(field, MagnetField):
        magnet = field.magnet
        axis = np.array(magnet.axes()[2][:2])
        if key == "gap_mm" and index is None:
            record.field[3:5] = -axis * scale
            return
        if key == "magnet.remanence_T" and index is None:
            if magnet.remanence_T == 0.0:
                raise InputError(
                    "magnet remanence_T must not be 0 T where its derivative is asked "
                    "for; instead received 0"
                )
            record.field[2] = 1.0 / magnet.remanence_T
            return
        if key == "magnet.axis_angle_deg" and index is None:
            turn = rad_from_deg(1.0)
            distance = (field.gap_mm + magnet.sides_mm[2] / 2.0) * scale
            record.field[3] = distance * axis[1] * turn
            record.field[4] = -distance * axis[0] * turn
            record.field[5] = turn
            return
        if key == "magnet.offset_mm" and index in (0, 1, 2):
            # Across the plane the field is symmetric: the planar shape does not change.
            if index < 2:
                record.field[3 + index] = scale
            return
    raise _unknown(name)


def _unknown(name: str) -> InputError:
    return InputError(
        f"parameter must be one that this case has, such as E_MPa[0], side_mm, "
        f"clamp_angle_deg, flux_mT (uniform field) or gap_mm (magnet); instead "
        f"received {name!r}"
    )
