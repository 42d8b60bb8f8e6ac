"""The posterior of the moduli by MCMC (emcee), where a Gaussian is not enough.

Moduli have a Gaussian prior on their logarithm, the paper's range as 95 % interval.
Nuisance parameters are integrated out in closed form: they enter nearly linearly and
have Gaussian priors, so the residuals get the covariance I + J P J^T, with J their
derivatives where the fit ended.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError, MagbendError, MissingExtraError
from ...core.progress import Progress, silent
from .records import Posterior
from .residuals import misfit, residuals
from .result import PRIOR_RANGE_MPA, FitResult

Array = NDArray[np.float64]


def check_installed() -> None:
    """Refuse before the work what cannot be sampled.

    Raises
    ------
    MissingExtraError
        If emcee is not installed.
    """
    try:
        import emcee  # noqa: F401
    except ImportError:
        raise MissingExtraError("emcee", "bayes", "the posterior") from None


def sample_posterior(
    result: FitResult,
    *,
    steps: int = 1000,
    walkers: int = 16,
    prior_MPa: tuple[float, float] = PRIOR_RANGE_MPA,
    seed: int = 0,
    progress: Progress = silent,
) -> Posterior:
    """Sample the moduli of a fit.

    Parameters
    ----------
    result : FitResult
        Where to start, and what to sample; fitted with moduli only.
    steps, walkers : int
        Length and number of the chains; the first quarter is burn-in.
    prior_MPa : tuple of float
        95 % prior range of each modulus.
    seed : int
        Of the walkers.

    Raises
    ------
    InputError
        If something else than moduli was fitted, or the chain is too short.
    MissingExtraError
        If emcee is not installed.
    """
    check_installed()
    import emcee

    problem = result.problem
    p = len(problem.names)
    if p != len(result.E_MPa):
        raise InputError("the posterior is of the moduli only; fit it without --free")
    if steps < 40:
        raise InputError(
            f"posterior steps must be 40 or more; instead received {steps}"
        )
    nominal = np.array([problem.nominal(name) for name in problem.names])
    centre = 0.5 * (math.log(prior_MPa[0]) + math.log(prior_MPa[1])) - np.log(nominal)
    width = math.log(prior_MPa[1] / prior_MPa[0]) / (2.0 * 1.96)
    _, jacobian = residuals(problem, result.unknowns)
    nuisance = jacobian[:, p:]
    inner = np.linalg.inv(np.eye(nuisance.shape[1]) + nuisance.T @ nuisance)
    held = np.zeros(problem.size)

    stopped: list[KeyboardInterrupt] = []

    def log_probability(u: Array) -> float:
        held[:p] = u
        try:
            data = misfit(problem, held)
        except MagbendError:
            return -math.inf  # moduli for which nothing can be solved
        except KeyboardInterrupt as stop:
            stopped.append(stop)  # emcee would print a traceback; told below
            return -math.inf
        seen = nuisance.T @ data
        chi2 = float(data @ data - seen @ inner @ seen)
        return -0.5 * (chi2 + float(np.sum(((u - centre) / width) ** 2)))

    rng = np.random.default_rng(seed)
    spread = np.sqrt(np.maximum(np.diag(result.covariance), 1e-8))
    start = result.unknowns[:p] + 0.3 * np.minimum(spread, 0.3) * rng.standard_normal(
        (walkers, p)
    )
    sampler = emcee.EnsembleSampler(walkers, p, log_probability)
    sampler.random_state = np.random.RandomState(seed).get_state()
    for done, _ in enumerate(sampler.sample(start, iterations=steps), start=1):
        if stopped:
            raise stopped[0]
        progress(done, steps)
    chain = sampler.get_chain(discard=steps // 4, flat=True)
    return Posterior(
        parameters=problem.names,
        samples=nominal * np.exp(chain),
        acceptance=float(np.mean(sampler.acceptance_fraction)),
        autocorrelation=float(np.max(sampler.get_autocorr_time(quiet=True, tol=0))),
        steps=steps,
    )
