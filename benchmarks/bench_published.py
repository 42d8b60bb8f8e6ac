"""Predict published experiments blind, from what their papers print; keep the score.

    python benchmarks/bench_published.py [--figure OUT.svg] [TABLE.csv ...]

Nothing is fitted: each row's stated deviations are drawn, every draw is solved, and the
middle 95 % is the band in which the measured value should lie.
docs/explanations/published.md tells the columns of a table.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from magbend.core.checks import shown
from magbend.core.cross_section import SIZES
from magbend.core.errors import ConfigError, MagbendError
from magbend.core.specimen import Section, Specimen
from magbend.core.table import Table, read_table
from magbend.core.units import GRAVITY_M_PER_S2, MU0
from magbend.sim import Support, UniformField, solve, solve_many

Array = NDArray[np.float64]

TABLES = Path(__file__).parent / "published"
DRAWS = 400
BAND = (2.5, 50.0, 97.5)
MOST_LOST = 0.05
"""Share of draws without a shape above which a row has no band."""
QUANTITIES = ("tip_x_mm", "tip_y_mm", "tip_y_per_length", "tip_angle_deg")
DRAWN = (
    ("length_mm", "length_sd_mm"),
    ("E_MPa", "E_sd_MPa"),
    ("remanence_mT", "remanence_sd_mT"),
    ("flux_mT", "flux_sd_mT"),
    ("angle_deg", "angle_sd_deg"),
)
WEIGHED = (
    ("density_kg_m3", "density_sd_kg_m3"),
    ("tip_mass_g", "tip_mass_sd_g"),
    ("clamp_deg", "clamp_sd_deg"),
)
"""Of tables that have these columns: rods with weight and a mass at the tip."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One measured value beside its prediction.

    `load` is the flux in mT, or the mass at the tip in g.
    """

    experiment: str
    source: str
    load: float
    quantity: str
    measured: float
    low: float
    predicted: float
    high: float

    @property
    def inside(self) -> bool:
        return self.low <= self.measured <= self.high


def predict(path: Path, *, draws: int = DRAWS, seed: int = 0) -> list[Row]:
    """Return the rows of a table with their predictions, in its order.

    Raises
    ------
    ConfigError
        If the table lacks a column, or a cell cannot be.
    InputError
        If a draw is no rod or no field.
    """
    table = read_table(path)
    texts = ("experiment", "source", "shape", "quantity")
    weighed = table.has("tip_mass_g")
    pairs = (*DRAWN, ("value", "value_sd"), *(WEIGHED if weighed else ()))
    table.require(*texts, *(name for pair in pairs for name in pair), "size_sd_mm")
    check_words(table)
    bands = np.full((len(table.rows), 3), np.nan)
    for shape in sorted(set(table.texts("shape"))):
        at = np.flatnonzero(np.array(table.texts("shape")) == shape)
        bands[at] = bands_of(table, at, shape, draws, np.random.default_rng(seed))
    words = (table.texts(name) for name in ("experiment", "source", "quantity"))
    return [
        Row(
            experiment=experiment,
            source=source,
            load=float(load),
            quantity=quantity,
            measured=float(value),
            low=float(low),
            predicted=float(middle),
            high=float(high),
        )
        for experiment, source, quantity, load, value, (low, middle, high) in zip(
            *words,
            table.numbers("tip_mass_g" if weighed else "flux_mT"),
            table.numbers("value"),
            bands,
            strict=True,
        )
    ]


def check_words(table: Table) -> None:
    """Refuse a shape or a quantity that is not known."""
    for name, known in (("shape", tuple(SIZES)), ("quantity", QUANTITIES)):
        for line, word in zip(table.lines, table.texts(name), strict=True):
            if word not in known:
                raise ConfigError(
                    f"{table.path}, line {line}: {name} must be one of "
                    f"{', '.join(known)}; instead received {shown(word)}"
                )


def bands_of(
    table: Table, at: NDArray[np.intp], shape: str, draws: int, rng: np.random.Generator
) -> Array:
    """Return low end, middle and high end of the bands of rows of one shape."""

    def drawn(name: str, deviation: str) -> Array:
        mean, sd = table.numbers(name)[at], table.numbers(deviation)[at]
        if np.any(sd < 0.0):
            raise ConfigError(f"{table.path}: {deviation} must not be below zero")
        return rng.normal(mean, sd, (draws, len(at))).ravel()

    weighed = table.has("tip_mass_g")
    rods = {name: drawn(name, deviation) for name, deviation in DRAWN}
    sizes = {name: drawn(name, "size_sd_mm") for name in SIZES[shape]}
    if weighed:
        rods |= {name: drawn(name, deviation) for name, deviation in WEIGHED}
        tips = weighed_tips(shape, rods, sizes)
    else:
        per_section = {name: rods[name][:, None] for name in ("length_mm", "E_MPa")}
        tips = solve_many({**rods, **per_section, **sizes})
    # In a field against the rod a draw may turn it to either side: mirror images.
    torque = (
        rods["remanence_mT"] * rods["flux_mT"] * np.sin(np.radians(rods["angle_deg"]))
    )
    side = np.where((torque < 0.0) & ~weighed, -1.0, 1.0)
    told = {
        "tip_x_mm": side * tips["tip_x_mm"],  # has no side
        "tip_y_mm": tips["tip_y_mm"],
        "tip_y_per_length": tips["tip_y_mm"] / rods["length_mm"],
        "tip_angle_deg": tips["tip_angle_deg"],
    }
    quantities = np.array(table.texts("quantity"))[at]
    chosen = np.stack([(side * told[name]).reshape(draws, -1) for name in QUANTITIES])
    values = chosen[
        [QUANTITIES.index(name) for name in quantities], :, np.arange(len(at))
    ]
    values = values + rng.normal(0.0, table.numbers("value_sd")[at], (draws, len(at))).T
    lost = np.isnan(values).mean(axis=1) > MOST_LOST
    values[lost] = np.nan
    bands = np.full((len(at), 3), np.nan)
    bands[~lost] = np.nanpercentile(values[~lost], BAND, axis=1).T
    return bands


def weighed_tips(
    shape: str, rods: dict[str, Array], sizes: dict[str, Array]
) -> dict[str, Array]:
    """Return tips of rods that weigh along -y, and carry a mass at the tip.

    The mass and a uniform field are one dead load at the tip, and so one field across
    a remanence of 1 T.
    """
    tips = np.full((3, len(rods["E_MPa"])), np.nan)
    for i in range(tips.shape[1]):
        own = {name: float(values[i]) for name, values in (rods | sizes).items()}
        rod = Specimen(
            name=f"draw {i}",
            shape=shape,
            **{name: own[name] for name in SIZES[shape]},  # type: ignore[arg-type]
            remanence_mT=1000.0,
            density_kg_m3=own["density_kg_m3"],
            sections=(Section(length_mm=own["length_mm"], E_MPa=own["E_MPa"]),),
        )
        flux = own["remanence_mT"] * own["flux_mT"] / 1000.0
        turn = np.radians(own["angle_deg"])
        weight_N = own["tip_mass_g"] * 1e-3 * GRAVITY_M_PER_S2
        along = flux * np.cos(turn)
        up = flux * np.sin(turn) - 1e9 * MU0 * weight_N / rod.cross_sections[0].area_mm2
        found = solve(
            rod,
            UniformField(
                flux_mT=float(np.hypot(along, up)),
                angle_deg=float(np.degrees(np.arctan2(up, along))),
            ),
            support=Support(
                clamp_angle_deg=own["clamp_deg"],
                gravity_m_s2=(0.0, -GRAVITY_M_PER_S2, 0.0),
            ),
        )
        if found.centreline is not None:
            tips[:, i] = *found.centreline.tip_mm, found.centreline.tip_angle_deg
    return dict(zip(("tip_x_mm", "tip_y_mm", "tip_angle_deg"), tips, strict=True))


def sets_of(rows: list[Row]) -> list[list[Row]]:
    """Return the rows by experiment, source and quantity, in their order."""

    def key(row: Row) -> tuple[str, str, str]:
        return row.experiment, row.source, row.quantity

    return [list(some) for _, some in groupby(rows, key=key)]


def print_rows(rows: list[Row]) -> None:
    """Print every value, and the score of each set."""
    for some in sets_of(rows):
        first = some[0]
        print(f"\n{first.experiment} ({first.source}), {first.quantity}")
        print(f"{'load':>6} {'measured':>9} {'predicted':>9} {'band':>19}")
        for row in some:
            print(
                f"{row.load:6g} {row.measured:9.3f} {row.predicted:9.3f} "
                f"{row.low:9.3f} {row.high:9.3f} {'' if row.inside else 'outside'}"
            )
        miss = np.mean([row.predicted - row.measured for row in some])
        inside = sum(row.inside for row in some)
        print(f"inside {inside} of {len(some)}; predicted less measured {miss:+.3f}")


def draw(rows: list[Row], out: Path) -> None:
    """Draw each set: bands as bars, measured values as dots, filled where outside."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    blue, orange = "#0072b2", "#d55e00"
    sets = sets_of(rows)
    lines = math.ceil(len(sets) / 3)
    size = (9.0, 1.9 * lines)
    figure, grid = plt.subplots(lines, 3, figsize=size, layout="constrained")
    for axes, some in zip(grid.flat, sets, strict=False):
        numbers = [(r.load, r.measured, r.predicted, r.low, r.high) for r in some]
        load, measured, middle, low, high = np.array(numbers).T
        out_of = np.array([not row.inside for row in some])
        axes.vlines(load, low, high, color=blue, linewidth=5, alpha=0.35)
        axes.plot(load, middle, "_", color=blue, markersize=6)
        for some_of, style in ((out_of, "full"), (~out_of, "none")):
            axes.plot(
                load[some_of], measured[some_of], "o", color=orange, markersize=3.5,
                fillstyle=style,
            )  # fmt: skip
        axes.set_title(f"{some[0].experiment} ({some[0].source})", fontsize=7)
        axes.set_ylabel(some[0].quantity, fontsize=7)
        weighed = some[0].quantity.endswith("_mm")
        axes.set_xlabel("mass at the tip, g" if weighed else "field, mT", fontsize=7)
        axes.tick_params(labelsize=6)
    for axes in grid.flat[len(sets) :]:
        axes.remove()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "published"}):
        figure.savefig(out, metadata={"Date": None})
    plt.close(figure)


def main() -> int:
    """Predict, print and draw every table."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("tables", nargs="*", type=Path, help="all of ours, by default")
    asked.add_argument("--figure", type=Path, help="a picture of all of them")
    told = asked.parse_args()
    everything = []
    try:
        for path in told.tables or sorted(TABLES.glob("*.csv")):
            print(path.name)
            rows = predict(path)
            print_rows(rows)
            print(f"\nin all {sum(row.inside for row in rows)} of {len(rows)} inside\n")
            everything += rows
    except MagbendError as error:
        print(error, file=sys.stderr)
        return 1
    if told.figure is not None:
        draw(everything, told.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
