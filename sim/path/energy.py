"""The energy of a shape: elastic, magnetic, and of its weight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.specimen import Specimen
from ...core.units import MU0
from ..fields import Field, Support
from ..probe import flux_mT

Array = NDArray[np.float64]

POINTS = 8
"""Gauss points of each section."""


def energy_uJ(
    specimen: Specimen, field: Field, support: Support, line: Centreline
) -> float:
    """Return the energy of a planar shape, in microjoules.

    Parameters
    ----------
    specimen, field, support
        The case.
    line : Centreline
        The shape: angle and place between its points are taken from cubics.

    Notes
    -----
    The integral of EI kappa^2 / 2 - m t . B - rho A g . r, by Gauss points between each
    two points of the shape; N mm is mJ.
    """
    nodes, weights = np.polynomial.legendre.leggauss(3)
    joints = np.array([0.0, *specimen.joints_mm, specimen.length_mm])
    edges = np.union1d(line.s_mm, joints)
    h = np.diff(edges)
    s = (edges[:-1, None] + h[:, None] * 0.5 * (nodes + 1.0)).ravel()
    w = (h[:, None] * 0.5 * weights).ravel()
    which = np.searchsorted(joints[1:-1], s)
    theta = np.interp(s, line.s_mm, line.theta_rad)
    kappa = np.interp(s, line.s_mm, line.kappa_per_mm)
    x, y = np.interp(s, line.s_mm, line.x_mm), np.interp(s, line.s_mm, line.y_mm)
    across = specimen.cross_sections
    area = np.array([one.area_mm2 for one in across])[which]
    EI = np.array(
        [
            part.E_MPa * one.in_plane_mm4
            for part, one in zip(specimen.sections, across, strict=True)
        ]
    )[which]
    moment = support.load_factor * area * np.array(specimen.remanences_mT)[which]
    points = np.column_stack([x, y, np.zeros(len(s))])
    flux = flux_mT(field, points, length_mm=specimen.length_mm)
    along = np.cos(theta) * flux[:, 0] + np.sin(theta) * flux[:, 1]
    elastic_mJ = w @ (0.5 * EI * kappa**2)
    # mT mT mm3 / mu0 is 1e-15 J over 4 pi 1e-7, in mJ times 1e3.
    magnetic_mJ = -(w @ (moment * along)) * 1e-15 / MU0 * 1e3
    g = support.gravity_m_s2
    weight_mJ = 0.0
    if specimen.density_kg_m3 is not None:
        lift = g[0] * x + g[1] * y
        weight_mJ = -specimen.density_kg_m3 * float(w @ (area * lift)) * 1e-12 * 1e3
    return float(elastic_mJ + magnetic_mJ + weight_mJ) * 1e3
