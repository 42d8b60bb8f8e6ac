"""Flux density and its gradient outside a cuboid magnet, in closed form.

A cuboid of half sides (a, b, c), polarised along its own z, has the field of two
charged faces z = +-c. With u = x -+ a, v = y -+ b, w = z -+ c, r = |(u, v, w)|,
K = B_r / 4 pi and the sign s of each corner (Furlani, Permanent Magnet and
Electromechanical Devices, 2001, sec. 4.3):

    Bx = K sum s ln(r + v),  By = K sum s ln(r + u),  Bz = -K sum s atan(u v / (w r))

and, since B has neither curl nor divergence outside, the gradient needs no derivative
of the arc tangent. Three measures keep all digits:

* The point is mirrored into x, y, z >= 0. There ln(r + v) cancels only for corners with
  v < 0, where r + v = (u^2 + w^2) / (r - v); what remains singular are the edges.
* The logarithms are taken once, of the product of their arguments.
* From `FAR` largest sides on, where eight corners nearly cancel (the loss grows with
  the third power of the distance), the volume is summed as 8^3 Gauss points of dipoles.

Lengths may have any one unit; fields are in T and gradients in T per that unit. A
magnet is a block of 16 numbers (`magnet_block`) so that kernels take one array.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.arrays import real_array
from ...core.checks import shown, within
from ...core.errors import InputError
from ...core.jit import njit
from ...core.magnet import Magnet

FAR = 4.0
"""Distance, in largest sides, from which the volume quadrature takes over."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_NODES = np.ascontiguousarray(_NODES)
_WEIGHTS = np.ascontiguousarray(_WEIGHTS / 2.0)


def magnet_block(
    magnet: Magnet, *, length_mm: float, gap_mm: float
) -> NDArray[np.float64]:
    """Return the magnet as the 16 numbers the kernels take.

    Returns
    -------
    ndarray, shape (16,)
        Half sides (3) in mm, centre (3) in mm, own axes as rows (9), remanence in T.
    """
    half = [side / 2.0 for side in magnet.sides_mm]
    centre = magnet.centre_mm(length_mm=length_mm, gap_mm=gap_mm)
    x_axis, y_axis, z_axis = magnet.axes()
    return np.array(
        [*half, *centre, *x_axis, *y_axis, *z_axis, magnet.remanence_T],
        dtype=np.float64,
    )


@njit(cache=True, inline="never")
def _far_field(a, b, c, J, x, y, z):  # type: ignore[no-untyped-def]
    """Field and gradient of the cuboid as 512 dipoles (own frame)."""
    bx = by = bz = gxx = gxy = gxz = gyy = gyz = 0.0
    for i in range(8):
        u = x - a * _NODES[i]
        for j in range(8):
            v = y - b * _NODES[j]
            for k in range(8):
                w = z - c * _NODES[k]
                r2 = u * u + v * v + w * w
                d = _WEIGHTS[i] * _WEIGHTS[j] * _WEIGHTS[k] / (r2 * r2 * math.sqrt(r2))
                q = 5.0 * w * w / r2
                bx += 3.0 * u * w * d
                by += 3.0 * v * w * d
                bz += (3.0 * w * w - r2) * d
                gxx += 3.0 * w * (1.0 - 5.0 * u * u / r2) * d
                gxy -= 15.0 * u * v * w / r2 * d
                gxz += 3.0 * u * (1.0 - q) * d
                gyy += 3.0 * w * (1.0 - 5.0 * v * v / r2) * d
                gyz += 3.0 * v * (1.0 - q) * d
    f = J * 8.0 * a * b * c / (4.0 * math.pi)
    return f * bx, f * by, f * bz, f * gxx, f * gxy, f * gxz, f * gyy, f * gyz


@njit(cache=True, inline="never")
def _near_field(a, b, c, J, x, y, z):  # type: ignore[no-untyped-def]
    """Field and gradient of the cuboid by the corner sums (own frame, octant +++).

    Of the arc tangents two and two are taken at once, as that of their difference:
    each is below pi / 2, so none is a turn off.
    """
    num_x = den_x = num_y = den_y = 1.0
    bz = gxx = gxy = gxz = gyy = gyz = 0.0
    for j in range(2):
        v = y - b if j == 0 else y + b
        for k in range(2):
            w = z - c if k == 0 else z + c
            vv = v * v
            ww = w * w
            u0 = r0 = 0.0
            for i in range(2):
                u = x - a if i == 0 else x + a
                plus = (i + j + k) % 2 == 1
                s = 1.0 if plus else -1.0
                uu = u * u
                r = math.sqrt(uu + vv + ww)
                rv = r + v if v >= 0.0 else (uu + ww) / (r - v)
                ru = r + u if u >= 0.0 else (vv + ww) / (r - u)
                if plus:
                    num_x *= rv
                    num_y *= ru
                else:
                    den_x *= rv
                    den_y *= ru
                if i == 1 and w != 0.0:
                    across = v * (u * r0 - u0 * r) * w
                    bz -= s * math.atan2(across, ww * r * r0 + u * u0 * vv)
                u0 = u
                r0 = r
                p = s / r
                f = p / rv
                g = p / ru
                gxx += u * f
                gxy += p
                gxz += w * f
                gyy += v * g
                gyz += w * g
    f = J / (4.0 * math.pi)
    bx = math.log(num_x / den_x)
    by = math.log(num_y / den_y)
    return f * bx, f * by, f * bz, f * gxx, f * gxy, f * gxz, f * gyy, f * gyz


@njit(cache=True)
def cuboid_flux(block, x, y, z, out):  # type: ignore[no-untyped-def]
    """Write B and its gradient at a point outside the magnet into `out`.

    Parameters
    ----------
    block : ndarray, shape (16,)
        The magnet (`magnet_block`).
    x, y, z : float
        The point in the specimen frame, in the unit of the block.
    out : ndarray, shape (12,)
        Bx, By, Bz in T, then dB_i/dx_j row by row in T per that unit.

    Notes
    -----
    Inside the magnet and on its edges the numbers mean nothing: check first with
    `inside`.
    """
    a = block[0]
    b = block[1]
    c = block[2]
    dx = x - block[3]
    dy = y - block[4]
    dz = z - block[5]
    px = block[6] * dx + block[7] * dy + block[8] * dz
    py = block[9] * dx + block[10] * dy + block[11] * dz
    pz = block[12] * dx + block[13] * dy + block[14] * dz
    sx = -1.0 if px < 0.0 else 1.0
    sy = -1.0 if py < 0.0 else 1.0
    sz = -1.0 if pz < 0.0 else 1.0
    px = abs(px)
    py = abs(py)
    pz = abs(pz)
    far = 2.0 * FAR * max(a, b, c)
    if px * px + py * py + pz * pz > far * far:
        f = _far_field(a, b, c, block[15], px, py, pz)
    else:
        f = _near_field(a, b, c, block[15], px, py, pz)
    # Bx is odd in x and z, By in y and z, Bz even in all.
    bx = sx * sz * f[0]
    by = sy * sz * f[1]
    bz = f[2]
    gxx = sz * f[3]
    gxy = sx * sy * sz * f[4]
    gxz = sx * f[5]
    gyy = sz * f[6]
    gyz = sy * f[7]
    gzz = -(gxx + gyy)
    for i in range(3):
        ri = block[6 + i]
        si = block[9 + i]
        ti = block[12 + i]
        out[i] = ri * bx + si * by + ti * bz
        hx = ri * gxx + si * gxy + ti * gxz
        hy = ri * gxy + si * gyy + ti * gyz
        hz = ri * gxz + si * gyz + ti * gzz
        for j in range(3):
            out[3 + 3 * i + j] = (
                hx * block[6 + j] + hy * block[9 + j] + hz * block[12 + j]
            )


@njit(cache=True, error_model="numpy")
def plane_flux(block, x, y):  # type: ignore[no-untyped-def]
    """Return (Bx, By, dBx/dx, dBx/dy, dBy/dy) in the plane z = 0 of the specimen.

    For magnets symmetric about that plane (no elevation, no offset along z), whose own
    x and z axes lie in it: half the work of `cuboid_flux`. The gradient is symmetric.
    """
    a = block[0]
    b = block[1]
    c = block[2]
    dx = x - block[3]
    dy = y - block[4]
    px = block[6] * dx + block[7] * dy
    pz = block[12] * dx + block[13] * dy
    sx = -1.0 if px < 0.0 else 1.0
    sz = -1.0 if pz < 0.0 else 1.0
    px = abs(px)
    pz = abs(pz)
    far = 2.0 * FAR * max(a, b, c)
    if px * px + pz * pz > far * far:
        f = _far_field(a, b, c, block[15], px, 0.0, pz)
        bx, bz, gxx, gxz, gzz = f[0], f[2], f[3], f[5], -(f[3] + f[6])
    else:
        bx, bz, gxx, gxz, gzz = _near_plane(a, b, c, block[15], px, pz)
    bx *= sx * sz
    gxx *= sz
    gxz *= sx
    gzz *= sz
    rx = block[6]
    ry = block[7]
    tx = block[12]
    ty = block[13]
    hx = rx * gxx + tx * gxz
    hz = rx * gxz + tx * gzz
    return (
        rx * bx + tx * bz,
        ry * bx + ty * bz,
        hx * rx + hz * tx,
        hx * ry + hz * ty,
        ry * (ry * gxx + ty * gxz) + ty * (ry * gxz + ty * gzz),
    )


@njit(cache=True, error_model="numpy")
def _near_plane(a, b, c, J, x, z):  # type: ignore[no-untyped-def]
    """Field and gradient in the magnet's own plane y = 0, for x, z >= 0.

    The four arc tangents are taken at once, as the angle of a product of complex
    numbers. No turn is lost: their sum is half the difference of the angles that two
    faces fill, which outside of the magnet is below pi.
    """
    num = den = re = 1.0
    im = gxx = gxz = gyy = 0.0
    for i in range(2):
        u = x - a if i == 0 else x + a
        for k in range(2):
            w = z - c if k == 0 else z + c
            s = 1.0 if i == k else -1.0
            d = u * u + w * w
            r = math.sqrt(d + b * b)
            if i == k:
                num *= (r + b) * (r + b)
                den *= d
            else:
                den *= (r + b) * (r + b)
                num *= d
            across = -s * u * b if w >= 0.0 else s * u * b
            along = abs(w) * r
            re, im = re * along - im * across, re * across + im * along
            # r + u is a quotient where it cancels; one division serves all.
            over, under = (1.0, r + u) if u >= 0.0 else (r - u, b * b + w * w)
            q = s * b / (r * d * under)
            gxx -= u * q * under
            gxz -= w * q * under
            gyy += q * d * over
    f = J / (4.0 * math.pi)
    gxx *= 2.0
    gyy *= 2.0
    return (
        f * math.log(num / den),
        2.0 * f * math.atan2(im, re),
        f * gxx,
        f * 2.0 * gxz,
        -f * (gxx + gyy),
    )


@njit(cache=True, error_model="numpy")
def inside(block, x, y, z, margin):  # type: ignore[no-untyped-def]
    """Tell whether a point is within `margin` of the cuboid (or on it, or in it)."""
    dx = x - block[3]
    dy = y - block[4]
    dz = z - block[5]
    ex = abs(block[6] * dx + block[7] * dy + block[8] * dz) - block[0]
    ey = abs(block[9] * dx + block[10] * dy + block[11] * dz) - block[1]
    ez = abs(block[12] * dx + block[13] * dy + block[14] * dz) - block[2]
    ex = max(ex, 0.0)
    ey = max(ey, 0.0)
    ez = max(ez, 0.0)
    return ex * ex + ey * ey + ez * ez <= margin * margin


@njit(cache=True)
def dipole_flux(moment, x, y, z, out):  # type: ignore[no-untyped-def]
    """Write B and gradient of a dipole at the origin into `out` (as `cuboid_flux`).

    `moment` holds mu0 m / 4 pi, shape (3,), in T times the cube of the length unit.
    """
    p = (x, y, z)
    r2 = x * x + y * y + z * z
    mp = moment[0] * x + moment[1] * y + moment[2] * z
    d = 1.0 / (r2 * r2 * math.sqrt(r2))
    for i in range(3):
        out[i] = (3.0 * mp * p[i] - moment[i] * r2) * d
        for j in range(3):
            same = mp if i == j else 0.0
            out[3 + 3 * i + j] = (
                3.0 * (moment[i] * p[j] + moment[j] * p[i] + same)
                - 15.0 * mp * p[i] * p[j] / r2
            ) * d


@njit(cache=True)
def _flux_table(block, points, out):  # type: ignore[no-untyped-def]
    """Fill `out` (n, 12) for `points` (n, 3); return the first point inside, or -1."""
    for n in range(points.shape[0]):
        if inside(block, points[n, 0], points[n, 1], points[n, 2], 0.0):
            return n
        cuboid_flux(block, points[n, 0], points[n, 1], points[n, 2], out[n])
    return -1


def magnet_flux_mT(
    magnet: Magnet, points_mm: ArrayLike, *, length_mm: float, gap_mm: float
) -> NDArray[np.float64]:
    """Return the magnet's flux density at points of the specimen frame.

    Parameters
    ----------
    magnet : Magnet
        The cuboid and its pose.
    points_mm : array_like, shape (n, 3) or (3,)
        Points in the specimen frame, in mm.
    length_mm : float
        Length of the rod whose undeformed tip fixes the gap, in mm.
    gap_mm : float
        From the centre of the N face to that tip, in mm.

    Returns
    -------
    ndarray, shape (n, 3) or (3,)
        Flux density in mT.

    Raises
    ------
    InputError
        If a point is not finite, or inside the magnet or on its surface.
    """
    table = _table(magnet, points_mm, length_mm=length_mm, gap_mm=gap_mm)
    return table[..., :3] * 1e3


def magnet_gradient_mT_per_mm(
    magnet: Magnet, points_mm: ArrayLike, *, length_mm: float, gap_mm: float
) -> NDArray[np.float64]:
    """Return dB_i/dx_j in mT/mm, shape (n, 3, 3) or (3, 3) (see `magnet_flux_mT`)."""
    table = _table(magnet, points_mm, length_mm=length_mm, gap_mm=gap_mm)
    return table[..., 3:].reshape(*table.shape[:-1], 3, 3) * 1e3


def _table(
    magnet: Magnet, points_mm: ArrayLike, *, length_mm: float, gap_mm: float
) -> NDArray[np.float64]:
    if not isinstance(magnet, Magnet):
        raise InputError(f"magnet must be a Magnet; instead received {shown(magnet)}")
    length_mm = within(length_mm, 0.0, 1e9, "length_mm", "mm")
    gap_mm = within(gap_mm, 0.0, 1e9, "gap_mm", "mm")
    points = real_array(points_mm, "points_mm", "mm")
    if points.shape[-1:] != (3,) or np.any(np.abs(points) > 1e9):
        raise InputError(
            "points_mm must be positions (x, y, z) within 1e+09 mm; instead received "
            f"an array of shape {points.shape}"
        )
    flat = np.ascontiguousarray(points.reshape(-1, 3))
    out = np.empty((len(flat), 12))
    block = magnet_block(magnet, length_mm=length_mm, gap_mm=gap_mm)
    bad = _flux_table(block, flat, out)
    if bad >= 0:
        x, y, z = flat[bad]
        raise InputError(
            f"points_mm must lie outside the magnet; instead received ({x:g}, {y:g}, "
            f"{z:g}) mm, which is inside it or on its surface"
        )
    return out.reshape(*points.shape[:-1], 12)
