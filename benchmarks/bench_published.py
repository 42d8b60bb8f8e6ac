"""Predict published experiments blind, from what their papers print; keep the score.

    python benchmarks/bench_published.py [TABLE.csv ...]

Nothing is fitted: each row's stated deviations are drawn, every draw is solved, and the
middle 95 % is the band in which the measured value should lie.
docs/explanations/published.md tells the columns of a table.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from magbend.core.checks import shown
from magbend.core.cross_section import SIZES
from magbend.core.errors import ConfigError, MagbendError
from magbend.core.table import Table, read_table
from magbend.sim import solve_many

Array = NDArray[np.float64]

TABLES = Path(__file__).parent / "published"
DRAWS = 400
BAND = (2.5, 50.0, 97.5)
MOST_LOST = 0.05
"""Share of draws without a shape above which a row has no band."""
QUANTITIES = ("tip_y_mm", "tip_y_per_length", "tip_angle_deg")
DRAWN = (
    ("length_mm", "length_sd_mm"),
    ("E_MPa", "E_sd_MPa"),
    ("remanence_mT", "remanence_sd_mT"),
    ("flux_mT", "flux_sd_mT"),
    ("angle_deg", "angle_sd_deg"),
)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One measured value beside its prediction."""

    experiment: str
    source: str
    flux_mT: float
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
    pairs = (*DRAWN, ("value", "value_sd"))
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
            flux_mT=float(flux),
            quantity=quantity,
            measured=float(value),
            low=float(low),
            predicted=float(middle),
            high=float(high),
        )
        for experiment, source, quantity, flux, value, (low, middle, high) in zip(
            *words,
            table.numbers("flux_mT"),
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

    rods = {name: drawn(name, deviation) for name, deviation in DRAWN}
    sizes = {name: drawn(name, "size_sd_mm") for name in SIZES[shape]}
    per_section = {name: rods[name][:, None] for name in ("length_mm", "E_MPa")}
    tips = solve_many({**rods, **per_section, **sizes})
    # In a field against the rod a draw may turn it to either side: mirror images.
    torque = (
        rods["remanence_mT"] * rods["flux_mT"] * np.sin(np.radians(rods["angle_deg"]))
    )
    side = np.where(torque < 0.0, -1.0, 1.0)
    told = {
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


def print_rows(rows: list[Row]) -> None:
    """Print every value, and the score of each experiment."""
    for (experiment, source), group in groupby(
        rows, key=lambda row: (row.experiment, row.source)
    ):
        some = list(group)
        print(f"\n{experiment} ({source}), {some[0].quantity}")
        print(f"{'mT':>6} {'measured':>9} {'predicted':>9} {'band':>19}")
        for row in some:
            print(
                f"{row.flux_mT:6g} {row.measured:9.3f} {row.predicted:9.3f} "
                f"{row.low:9.3f} {row.high:9.3f} {'' if row.inside else 'outside'}"
            )
        miss = np.mean([row.predicted - row.measured for row in some])
        inside = sum(row.inside for row in some)
        print(f"inside {inside} of {len(some)}; predicted less measured {miss:+.3f}")


def main(paths: list[Path]) -> int:
    """Predict and print every table."""
    try:
        for path in paths:
            print(path.name)
            rows = predict(path)
            print_rows(rows)
            print(f"\nin all {sum(row.inside for row in rows)} of {len(rows)} inside\n")
    except MagbendError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    given = [Path(name) for name in sys.argv[1:]]
    sys.exit(main(given or sorted(TABLES.glob("*.csv"))))
