"""A twin bench that differs from what its files say, in everything a bench may.

Names of deviations are those of the fit's nuisances (docs/analysis.md).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...core.cross_section import ALL_SIZES
from ...core.magnet import Magnet
from ...core.specimen import Specimen
from .bench import HiddenTruth


def deviating(
    nominal: Specimen, magnet: Magnet, off: Mapping[str, float]
) -> HiddenTruth:
    """Return a truth that is off its nominal values by `off`.

    Parameters
    ----------
    off : mapping of str to float
        ``E_percent[i]``, ``side_percent``, ``length_mm`` (at the tip), ``joint_mm[i]``,
        ``remanence_percent``, ``remanence_profile_percent`` (at the tip, minus that at
        the root), ``density_percent``, ``natural_curvature_per_mm``,
        ``clamp_angle_deg``, ``gap_mm``, ``magnet_offset_mm``, ``magnet_percent``,
        ``meter_percent``, ``meter_offset_mT``. What is not named is nominal.
    """

    def factor(name: str) -> float:
        return 1.0 + off.get(name, 0.0) / 100.0

    count = len(nominal.sections)
    ends = np.cumsum([section.length_mm for section in nominal.sections])
    middles = ends - 0.5 * np.diff(ends, prepend=0.0)
    ends += [off.get(f"joint_mm[{i}]", 0.0) for i in range(count)]
    ends[-1] += off.get("length_mm", 0.0)
    slope = off.get("remanence_profile_percent", 0.0) / 100.0
    along = 1.0 + slope * (2.0 * middles / nominal.length_mm - 1.0)
    sections = tuple(
        replace(
            section,
            length_mm=float(length),
            E_MPa=section.E_MPa * factor(f"E_percent[{i}]"),
            remanence_mT=nominal.remanences_mT[i]
            * factor("remanence_percent")
            * float(along[i]),
            **{
                name: size * factor("side_percent")
                for name in ALL_SIZES
                if (size := getattr(section, name)) is not None
            },
        )
        for i, (section, length) in enumerate(
            zip(nominal.sections, np.diff(ends, prepend=0.0), strict=True)
        )
    )
    density = nominal.density_kg_m3
    x, y, z = magnet.offset_mm
    return HiddenTruth(
        specimen=replace(
            nominal,
            sections=sections,
            density_kg_m3=None
            if density is None
            else density * factor("density_percent"),
            natural_curvature_per_mm=nominal.natural_curvature_per_mm
            + off.get("natural_curvature_per_mm", 0.0),
            **{
                name: size * factor("side_percent")
                for name in ALL_SIZES
                if (size := getattr(nominal, name)) is not None
            },
        ),
        magnet=replace(
            magnet,
            remanence_T=magnet.remanence_T * factor("magnet_percent"),
            offset_mm=(x + off.get("magnet_offset_mm", 0.0), y, z),
        ),
        clamp_angle_deg=off.get("clamp_angle_deg", 0.0),
        gap_mm=off.get("gap_mm", 0.0),
        meter_gain=factor("meter_percent"),
        meter_offset_mT=off.get("meter_offset_mT", 0.0),
    )


def drawn(
    sds: Mapping[str, float],
    sections: int,
    rng: np.random.Generator,
    *,
    E_percent: float = 10.0,
) -> dict[str, float]:
    """Return deviations drawn from normal distributions of the given width.

    Moduli are drawn from a log-normal one of width `E_percent`, each by itself.
    """
    off = {name: sd * float(rng.standard_normal()) for name, sd in sds.items()}
    for i in range(sections):
        ratio = math.exp(E_percent / 100.0 * float(rng.standard_normal()))
        off[f"E_percent[{i}]"] = 100.0 * (ratio - 1.0)
    return off
