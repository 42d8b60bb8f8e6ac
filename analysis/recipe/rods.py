"""What the runs of several rods say of their moduli and remanences, together.

Each rod is fitted by itself. Rods fitted before one magnet with one Tesla-meter err
together by what is not known of these: least squares are linear around their solution,
so the part of an error that comes from a shared prior is known, and with it the
covariance of all rods.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.errors import StoreError
from ..fit.nuisance import scope_of
from ..fit.result import FitResult
from ..fit.runs import fit_runs
from ..runs.data import RunData
from .material import Mixture, mixtures

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rods:
    """Moduli and remanences of rods, by their logarithms.

    Attributes
    ----------
    names : tuple of str
        Of the rods.
    log_E, log_remanence : ndarray, shapes (n,), (m,)
        Of MPa, section by section, and of mT, rod by rod.
    covariance : ndarray, shape (n + m, n + m)
        Of both, without scatter between rods.
    mixtures : tuple of Mixture
        Of the sections.
    rod : ndarray, shape (n,)
        Index of the rod that a section is of.
    first : ndarray, shape (m,)
        Index of the first section of each rod.
    """

    names: tuple[str, ...]
    log_E: Array
    log_remanence: Array
    covariance: Array
    mixtures: tuple[Mixture, ...]
    rod: NDArray[np.int64]
    first: NDArray[np.int64]


def fit_rods(runs: Sequence[RunData]) -> Rods:
    """Fit every rod of the runs by itself, and say how their errors hang together.

    Raises
    ------
    InputError
        If a specimen does not say what it was mixed from.
    StoreError
        If the moduli of a rod cannot be told.
    """
    by_rod: dict[object, list[RunData]] = {}
    for run in runs:
        by_rod.setdefault((run.specimen, run.magnet), []).append(run)
    mixed = [mixtures(group[0].specimen) for group in by_rod.values()]
    fits = [fit_runs(group, judged=False) for group in by_rod.values()]
    for fit in fits:
        if fit.not_identifiable:
            raise StoreError(
                f"{fit.problem.shots[0].label}: the photographs do not tell "
                f"{', '.join(fit.not_identifiable)}; leave the run out"
            )
    counts = [len(fit.E_MPa) for fit in fits]
    benches = [group[0].magnet for group in by_rod.values()]
    maps = [_map(fit) for fit in fits]
    sections, rods = sum(counts), len(fits)
    covariance = np.zeros((sections + rods, sections + rods))
    starts = np.cumsum([0, *counts[:-1]])
    where = [
        np.array([*range(start, start + count), sections + i])
        for i, (start, count) in enumerate(zip(starts, counts, strict=True))
    ]
    for i in range(rods):
        own, _ = maps[i]
        covariance[np.ix_(where[i], where[i])] = own
        for j in range(i):
            if benches[i] == benches[j]:
                shared = sum(
                    np.outer(a, maps[j][1][name])
                    for name, a in maps[i][1].items()
                    if name in maps[j][1]
                )
                covariance[np.ix_(where[i], where[j])] = shared
                covariance[np.ix_(where[j], where[i])] = np.transpose(shared)
    return Rods(
        names=tuple(fit.specimen.name for fit in fits),
        log_E=np.log(np.concatenate([fit.E_MPa for fit in fits])),
        log_remanence=np.array([_log_remanence(fit) for fit in fits]),
        covariance=covariance,
        mixtures=tuple(part for parts in mixed for part in parts),
        rod=np.repeat(np.arange(rods), counts),
        first=starts,
    )


def _remanence_index(fit: FitResult) -> int | None:
    names = [name for name, _ in fit.problem.nuisances]
    return names.index("remanence_percent") if "remanence_percent" in names else None


def _log_remanence(fit: FitResult) -> float:
    stated = abs(fit.problem.specimen.remanence_mT)
    k = _remanence_index(fit)
    value = fit.nuisance[k]["value"] if k is not None else 0.0
    return float(np.log(stated * (1.0 + value / 100.0)))


def _map(fit: FitResult) -> tuple[Array, dict[str, Array]]:
    """Return the covariance of moduli and remanence, and what shared priors give it.

    Notes
    -----
    x = (A^T A)^-1 A^T y: the error of x by a prior's own error e is the column of the
    inverse information times -e.
    """
    problem, p = fit.problem, len(fit.E_MPa)
    inverse = np.linalg.pinv(fit.linear.information, hermitian=True)
    select = np.zeros((p + 1, problem.size))
    select[:p, :p] = np.eye(p)
    k = _remanence_index(fit)
    if k is not None:
        select[p, p + k] = problem.nuisance_sd[k] / 100.0
    shared = {
        name: -select @ inverse[:, p + n]
        for n, (name, _) in enumerate(problem.nuisances)
        if scope_of(name) == "bench"
    }
    return select @ inverse @ select.T, shared
