"""Train the expansion model as the paper does, on three splits, with JAX and optax.

L1 loss, Adam with a learning rate of 1e-3 (falling to zero as a cosine), all training
cases in each step, inputs standardised, targets divided by 0.005 1/mm. The paper says
nothing of widths, number of steps or input scaling; ours are 64, 64 and 3000. Dividing
the target is what takes the test error from the published 2e-7 to under 1e-8 1/mm^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import within
from ...core.errors import MissingExtraError
from ...core.progress import Progress, silent
from .data import SPLITS, TrainingSet, held_out, training_set
from .model import BRANCHES, INPUTS, NORM_EPSILON, ExpansionModel

Array = NDArray[np.float64]

TARGET_SCALE_PER_MM = 0.005
LEARNING_RATE = 1e-3
STEPS = 3000
WIDTH = 64
PUBLISHED_MSE_PER_MM2 = 2.089e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingReport:
    """Errors of every seed of every split, and the model trained on all cases.

    Parameters
    ----------
    seeds : int
    test_mse_per_mm2 : dict of str to ndarray, shape (seeds,)
        Mean squared error of a on the cases held out, per split.
    tip_error_mm : dict of str to ndarray, shape (seeds,)
        Largest |error of a| x_tip^2 of the cases held out: what it means at the tip.
    model : ExpansionModel
        Trained on all 84 cases; its card holds the errors of the splits.
    """

    seeds: int
    test_mse_per_mm2: dict[str, Array]
    tip_error_mm: dict[str, Array]
    model: ExpansionModel

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as they are printed for machines.

        ``median_test_mse_per_mm2`` is that of the paper's split (``field``).
        """
        medians = {
            split: float(np.median(errors))
            for split, errors in self.test_mse_per_mm2.items()
        }
        return {
            "median_test_mse_per_mm2": medians["field"],
            "worst_test_mse_per_mm2": float(self.test_mse_per_mm2["field"].max()),
            "median_test_mse_per_split_per_mm2": medians,
            "test_mse_per_mm2": {
                split: errors.tolist()
                for split, errors in self.test_mse_per_mm2.items()
            },
            "tip_error_mm": {
                split: errors.tolist() for split, errors in self.tip_error_mm.items()
            },
            "seeds": list(range(self.seeds)),
            "splits": {
                "field": "one random field of each GMC held out (the paper's split)",
                "top_field": "120 mT of each GMC held out",
                "specimen": "one whole GMC held out",
            },
            "published_test_mse_per_mm2": PUBLISHED_MSE_PER_MM2,
        }


def train(
    *, seeds: int = 10, steps: int = STEPS, progress: Progress = silent
) -> TrainingReport:
    """Train one network for each seed and split, and one on all cases.

    Parameters
    ----------
    seeds : int
        Seeds 0 to `seeds` - 1 decide both the split and the initial weights.
    steps : int
        Optimiser steps of each training.
    progress : Progress

    Raises
    ------
    MissingExtraError
        If JAX or optax is not installed.
    InputError
        If seeds or steps are out of range.
    """
    seeds = int(within(seeds, 1, 1000, "seeds", ""))
    steps = int(within(steps, 1, 1_000_000, "steps", ""))
    data = training_set()
    mean, scale = data.inputs.mean(axis=0), data.inputs.std(axis=0)
    fit = _trainer((data.inputs - mean) / scale, data.a_per_mm, steps)
    mse: dict[str, Array] = {}
    tip: dict[str, Array] = {}
    total, done = seeds * len(SPLITS) + 1, 0
    for split in SPLITS:
        figures = []
        for seed in range(seeds):
            test = held_out(split, seed)
            _, predicted = fit(seed, ~test)
            error = (predicted - data.a_per_mm)[test]
            at_tip = np.abs(error) * data.tip_x_mm[test] ** 2
            figures.append((np.mean(error**2), np.max(at_tip)))
            done += 1
            progress(done, total)
        mse[split], tip[split] = np.array(figures).T
    weights, predicted = fit(0, np.ones(len(data.a_per_mm), dtype=np.bool_))
    progress(total, total)
    card = _card(data, steps, seeds, mse, tip, predicted - data.a_per_mm)
    model = ExpansionModel(
        weights=weights,
        mean=mean,
        scale=scale,
        target_scale_per_mm=TARGET_SCALE_PER_MM,
        card=card,
    )
    return TrainingReport(
        seeds=seeds, test_mse_per_mm2=mse, tip_error_mm=tip, model=model
    )


def _trainer(z: Array, a_per_mm: Array, steps: int) -> Any:
    """Return ``fit(seed, used) -> (weights, predicted a)``, compiled once."""
    try:
        import jax
        import jax.numpy as jnp
        import optax
    except ImportError as error:
        raise MissingExtraError(
            error.name or "jax", "train", "training the expansion model"
        ) from None
    inputs = jnp.asarray(z, jnp.float32)
    target = jnp.asarray(a_per_mm / TARGET_SCALE_PER_MM, jnp.float32)
    optimiser = optax.adam(optax.cosine_decay_schedule(LEARNING_RATE, steps))

    def forward(p: Any) -> Any:
        parts = []
        for name, columns in BRANCHES.items():
            h = inputs[:, columns] @ p[f"{name}.weight"] + p[f"{name}.bias"]
            h = jax.nn.relu(h)
            spread = jnp.sqrt(h.var(axis=1, keepdims=True) + NORM_EPSILON)
            h = (h - h.mean(axis=1, keepdims=True)) / spread
            parts.append(h * p[f"{name}.gain"] + p[f"{name}.shift"])
        fused = jnp.concatenate(parts, axis=1) @ p["fusion.weight"] + p["fusion.bias"]
        out = jax.nn.relu(fused) @ p["output.weight"] + p["output.bias"]
        return out[:, 0]

    @jax.jit
    def run(start: Any, used: Any) -> Any:
        def loss(p: Any) -> Any:
            return jnp.sum(jnp.abs(forward(p) - target) * used) / jnp.sum(used)

        def step(carry: Any, _: None) -> Any:
            p, state = carry
            updates, state = optimiser.update(jax.grad(loss)(p), state)
            return (optax.apply_updates(p, updates), state), None

        (p, _), _ = jax.lax.scan(
            step, (start, optimiser.init(start)), None, length=steps
        )
        return p, forward(p)

    def fit(seed: int, used: NDArray[np.bool_]) -> tuple[dict[str, Array], Array]:
        weights, output = run(_initial(seed), jnp.asarray(used, jnp.float32))
        plain = {name: np.asarray(w, dtype=np.float64) for name, w in weights.items()}
        return plain, np.asarray(output, dtype=np.float64) * TARGET_SCALE_PER_MM

    return fit


def _initial(seed: int) -> dict[str, NDArray[np.float32]]:
    """Uniform in +-1/sqrt(inputs), the default of common frameworks."""
    rng = np.random.default_rng([seed, 77])
    p: dict[str, NDArray[np.float32]] = {}

    def layer(name: str, inputs: int, outputs: int) -> None:
        bound = 1.0 / np.sqrt(inputs)
        for part, shape in (("weight", (inputs, outputs)), ("bias", (outputs,))):
            drawn = rng.uniform(-bound, bound, size=shape)
            p[f"{name}.{part}"] = drawn.astype(np.float32)

    for name, columns in BRANCHES.items():
        layer(name, columns.stop - columns.start, WIDTH)
        p[f"{name}.gain"] = np.ones(WIDTH, dtype=np.float32)
        p[f"{name}.shift"] = np.zeros(WIDTH, dtype=np.float32)
    layer("fusion", len(BRANCHES) * WIDTH, WIDTH)
    layer("output", WIDTH, 1)
    return p


def _card(
    data: TrainingSet,
    steps: int,
    seeds: int,
    mse: dict[str, Array],
    tip: dict[str, Array],
    residual: Array,
) -> dict[str, Any]:
    designs = np.unique(data.inputs[:, 1:], axis=0)
    return {
        "what": "expansion model: a of y = a x^2 from field, moduli, lengths, side",
        "units": {"output": "1/mm", "inputs": list(INPUTS)},
        "data": {
            "source": "magbend rod solver, uniform field at 90 deg, GMC 1 to 7",
            "sides_mm": "remeasured: 1.30, 0.97, 0.80",
            "cases": len(data.a_per_mm),
            "misfit_of_the_parabola_itself_mm": float(data.misfit_mm.max()),
        },
        "training": {
            "architecture": f"4 branches of {WIDTH}, fusion {WIDTH}, output 1",
            "loss": "L1",
            "optimiser": f"Adam, {LEARNING_RATE:g}, cosine decay, {steps} steps",
            "target_scale_per_mm": TARGET_SCALE_PER_MM,
            "trained_on": "all cases; the errors below are those of held-out cases",
        },
        "errors": {
            split: {
                "median_test_mse_per_mm2": float(np.median(mse[split])),
                "worst_test_mse_per_mm2": float(np.max(mse[split])),
                "median_tip_error_mm": float(np.median(tip[split])),
                "worst_tip_error_mm": float(np.max(tip[split])),
                "seeds": seeds,
            }
            for split in SPLITS
        },
        "training_mse_per_mm2": float(np.mean(residual**2)),
        "domain": {
            "range": {
                name: [float(column.min()), float(column.max())]
                for name, column in zip(INPUTS, data.inputs.T, strict=True)
            },
            "designs": designs.tolist(),
            "not_an_input": "remanence: the network learnt that of each trained GMC",
        },
    }
