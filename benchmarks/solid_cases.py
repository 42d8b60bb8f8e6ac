"""Rods, fields and weights drawn at random: the solid model against finite elements.

What is drawn anew is only what the solid model refuses, or what hardly bends.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from magbend.core.errors import InputError
from magbend.core.specimen import Section, Specimen
from magbend.core.specimen_file import specimen_dict
from magbend.sim import Cuboid, Support, Uniform, solve
from magbend.sim.fields import as_field

SHAPES = ("square", "rectangle", "round")


def draw(seed, shape=None):
    """Return rod, field, support and Poisson's ratio of a case.

    Rods 12 to 24 times as long as thick, half of them of two moduli; a uniform field in
    any direction or a cube magnet off the plane; weight in any direction. Strains up to
    0.2.
    """
    rng = np.random.default_rng(seed)
    shape = shape or SHAPES[seed % len(SHAPES)]
    while True:
        rod = _rod(rng, shape)
        nu = float(rng.uniform(0.1, 0.49))
        fall = rng.normal(size=3)
        fall *= 9.80665 / np.linalg.norm(fall)
        support = Support(gravity_m_s2=tuple(np.round(fall, 3).tolist()))
        field = _field(rng, rod.length_mm)
        try:
            found = solve(rod, field, support=support, model="solid", poisson_ratio=nu)
        except InputError:
            continue
        if found.centreline is None or found.morse_index:
            continue
        moved = found.points_mm[-1] - [rod.length_mm, 0.0, 0.0]
        if np.linalg.norm(moved) > 0.1 * rod.length_mm:
            return rod, field, support, round(nu, 3)


def _rod(rng, shape):
    size = float(np.round(rng.uniform(0.6, 1.6), 3))
    if shape == "square":
        sizes = {"side_mm": size}
    elif shape == "round":
        sizes = {"diameter_mm": size}
    elif shape == "tube":
        bore = float(np.round(size * rng.uniform(0.2, 0.6), 3))
        sizes = {"diameter_mm": size, "bore_mm": bore}
    else:
        ratio = np.exp(rng.uniform(-1.0, 1.0) * np.log(2.5))
        sizes = {"width_mm": float(np.round(size * ratio**0.5, 3)),
                 "height_mm": float(np.round(size / ratio**0.5, 3))}  # fmt: skip
    L = max(sizes.values()) * rng.uniform(12.0, 24.0)
    E = np.exp(rng.uniform(np.log(0.2), np.log(3.0)))
    parts = [(1.0, 1.0)]
    if rng.random() < 0.5:
        joint = rng.uniform(0.35, 0.65)
        parts = [(joint, 1.0), (1.0 - joint, rng.uniform(0.4, 0.9))]
    return Specimen(
        name="drawn", shape=shape, **sizes,
        remanence_mT=float(np.round(rng.choice([-1, 1]) * rng.uniform(20.0, 100.0), 2)),
        density_kg_m3=float(np.round(rng.uniform(1500.0, 3000.0))),
        sections=tuple(
            Section(length_mm=float(np.round(L * part, 3)),
                    E_MPa=float(np.round(E * times, 4)))
            for part, times in parts
        ),
    )  # fmt: skip


def _field(rng, length_mm):
    if rng.random() < 0.5:
        return as_field(
            Uniform(
                flux_mT=float(np.round(rng.uniform(20.0, 150.0), 2)),
                angle_deg=float(np.round(rng.uniform(-180.0, 180.0), 2)),
                elevation_deg=float(np.round(rng.uniform(-60.0, 60.0), 2)),
            )
        )
    away = rng.uniform(1.6, 2.6)
    return as_field(
        Cuboid(
            sides_mm=25.0, remanence_T=1.3,
            centre_mm=(float(np.round(length_mm * rng.uniform(0.6, 1.1), 2)),
                       float(np.round(-25.0 * away, 2)),
                       float(np.round(rng.uniform(-15.0, 15.0), 2))),
        )
    )  # fmt: skip


def write_case(path, seed, rod, field, support, nu):
    """Write what `read_case` reads."""
    (source,) = field.sources
    part = {key: value for key, value in asdict(source).items() if value is not None}
    data = {
        "seed": seed,
        "specimen": specimen_dict(rod),
        "source": {"kind": source.kind, **part},
        "gravity_m_s2": support.gravity_m_s2,
        "poisson_ratio": nu,
    }
    path.write_text(json.dumps(data, indent=1) + "\n")


def read_case(path):
    """Return rod, field, support and Poisson's ratio."""
    data = json.loads(Path(path).read_text())
    given = data["specimen"]
    parts = tuple(Section(**part) for part in given.pop("section"))
    kinds = {"uniform": Uniform, "cuboid": Cuboid}
    source = data["source"]
    return (
        Specimen(**given, sections=parts),
        as_field(kinds[source.pop("kind")](**source)),
        Support(gravity_m_s2=tuple(data["gravity_m_s2"])),
        data["poisson_ratio"],
    )
