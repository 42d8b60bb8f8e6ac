"""Twin benches that differ from their files in one thing, each at a size that matters.

Everything else is off as a careful bench is: moduli 8 %, clamp 0.5 deg, magnet 1 %, its
axis 0.5 mm, its gap 0.2 mm. The magnet's file states its 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from magbend import sim
from magbend.analysis.fit.nuisance import Nuisance
from magbend.analysis.runs.data import RunData
from magbend.analysis.twin.bench import HiddenTruth, TwinBench
from magbend.analysis.twin.deviations import deviating, drawn
from magbend.analysis.twin.lines import LineErrors, lines_run
from magbend.core.magnet import Magnet, Vector
from magbend.core.specimen import Specimen

MAGNET = replace(Magnet.cube(55.0, 1.305), remanence_sd_T=0.013)
GAPS_MM = (70.0, 60.0, 50.0)
CAREFUL = {
    "clamp_angle_deg": 0.5, "gap_mm": 0.2, "magnet_offset_mm": 0.5,
    "magnet_percent": 1.0, "meter_percent": 0.3, "meter_offset_mT": 0.05,
}  # fmt: skip
CAREFUL_LINES = LineErrors(
    clamp_position_mm=0.002, scale_percent=0.05, width_percent=0.4, length_mm=0.01
)
DENSITY_KG_M3 = 2640.0


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """One wrong model: what is off, and the suspects that would be right.

    `told` says that three photographs can tell it from noise and from other causes.
    """

    off: dict[str, float] = field(default_factory=dict)
    right: tuple[str, ...]
    told: bool = True
    nominal: int = 0
    true: int = 0
    smooth: bool = False
    up: Vector | None = None


WRONG = {
    "side +3 %": Wrong(off={"side_percent": 3.0}, right=("side_percent",)),
    "tip section 11 mm": Wrong(off={"length_mm": 1.0}, right=("length_mm",)),
    "joints 11-9-10": Wrong(
        off={"joint_mm[0]": 1.0}, right=("joint_mm[0]", "section_length_mm[0]")
    ),
    "bow 1/5000 per mm": Wrong(
        off={"natural_curvature_per_mm": 1 / 5000}, right=("natural_curvature",)
    ),
    "bow 1/2000 per mm": Wrong(
        off={"natural_curvature_per_mm": 1 / 2000}, right=("natural_curvature",)
    ),
    "gap +3 mm": Wrong(off={"gap_mm": 3.0}, right=("gap_mm",)),
    "clamp 3 deg": Wrong(off={"clamp_angle_deg": 3.0}, right=("clamp_angle_deg",)),
    "meter gain +3 %": Wrong(
        off={"meter_percent": 3.0}, right=("meter_percent", "magnet_percent")
    ),
    "density -10 %": Wrong(
        off={"density_percent": -10.0}, right=("density_percent",), told=False,
        up=(0.0, 1.0, 0.0),
    ),
    "remanence 19-20-21 mT": Wrong(
        off={"remanence_profile_percent": 5.0}, right=("remanence_profile",)
    ),
    "smooth stiffness gradient": Wrong(
        right=("stiffness_gradient",), nominal=2, smooth=True
    ),
    "GMC 6 declared as GMC 7": Wrong(right=("the rod is GMC 6",), nominal=7, true=6),
}  # fmt: skip


def smooth(specimen: Specimen) -> Specimen:
    """Return the rod with moduli that change along straight lines, not in steps."""
    ends = np.array([0.0, *specimen.joints_mm, specimen.length_mm])
    E_MPa = [section.E_MPa for section in specimen.sections]
    s_mm = np.linspace(0.0, specimen.length_mm, 25)
    middles = 0.5 * (s_mm[1:] + s_mm[:-1])
    values = np.interp(middles, 0.5 * (ends[1:] + ends[:-1]), E_MPa)
    piece = replace(specimen.sections[0], length_mm=float(s_mm[1]), remanence_mT=None)
    sections = tuple(replace(piece, E_MPa=float(value)) for value in values)
    return replace(specimen, sections=sections)


def bench_of(wrong: Wrong, seed: int) -> tuple[TwinBench, list[float]]:
    """Return the bench, and the true moduli of the nominal sections."""
    rng = np.random.default_rng([seed, 11])
    nominal = sim.gmc(wrong.nominal or 1 + seed % 5)
    gravity = (0.0, 0.0, 0.0)
    if wrong.up is not None:
        nominal = replace(nominal, density_kg_m3=DENSITY_KG_M3)
        gravity = tuple(-9.80665 * part for part in wrong.up)  # type: ignore[assignment]
    off = drawn(CAREFUL, 3, rng, E_percent=0.0 if wrong.smooth else 8.0) | wrong.off
    other = sim.gmc(wrong.true) if wrong.true else nominal
    base = replace(other, remanence_mT=nominal.remanence_mT)
    truth = deviating(base, MAGNET, off)
    moduli = [section.E_MPa for section in truth.specimen.sections]
    if wrong.smooth:
        truth = replace(truth, specimen=smooth(truth.specimen))
    return TwinBench(
        nominal, MAGNET, seed=seed, truth=truth, gravity_m_s2=gravity
    ), moduli


def wrong_run(wrong: Wrong, seed: int) -> tuple[RunData, list[float]]:
    """Return a run on the bench, and the true moduli."""
    bench, moduli = bench_of(wrong, seed)
    rng = np.random.default_rng([seed, 12])
    up = wrong.up or (0.0, 0.0, 1.0)
    return lines_run(bench, GAPS_MM, rng, CAREFUL_LINES, up=up), moduli


def all_off(seed: int) -> tuple[TwinBench, LineErrors, np.random.Generator]:
    """Return a bench that is off in everything, within the fit's own priors."""
    rng = np.random.default_rng([seed, 7])
    nominal = sim.gmc(1 + seed % 7)
    priors = Nuisance()
    sds = priors.of_rod(nominal)
    for name in (
        "clamp_angle_deg", "gap_mm", "magnet_offset_mm", "meter_percent",
        "meter_offset_mT",
    ):  # fmt: skip
        sds[name] = getattr(priors, name)
    sds["magnet_percent"] = priors.magnet_sd_percent(MAGNET)
    truth: HiddenTruth = deviating(nominal, MAGNET, drawn(sds, 3, rng))
    shape_um, frame_deg = (0.3, 0.03) * np.exp((0.5, 0.4) * rng.standard_normal(2))
    errors = LineErrors(shape_um=float(shape_um), frame_angle_deg=float(frame_deg))
    return TwinBench(nominal, MAGNET, seed=seed, truth=truth), errors, rng
