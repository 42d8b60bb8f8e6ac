"""Kernels give the same numbers as plain Python and as machine code."""

from __future__ import annotations

import math
import pickle
import subprocess
import sys
import threading
import warnings
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from magbend.core import jit
from magbend.core.jit import njit, once


@njit()
def ratio(a, b):
    return a / b


@njit(error_model="numpy")
def quotient(a, b):
    return a / b


@njit()
def power_sum(x, n):
    total = 0.0
    for k in range(n):
        total += ratio(x, k + 1.0)
    return total


def test_a_kernel_called_by_a_kernel_compiles_with_it() -> None:
    harmonic = sum(2.0 / k for k in range(1, 11))
    assert power_sum(2.0, 10) == pytest.approx(harmonic, rel=1e-15)
    assert once(lambda: power_sum(2.0, 10)) == power_sum(2.0, 10)


@njit()
def part(x, share, halved):
    return 0.5 * x if halved else share * x


@njit()
def parts(x, n):
    return part(x, 3, False) + part(x, 4, False) + part(x, 0, True) + part(x, n, n > 2)


def test_a_kernel_is_compiled_once_for_all_constants_handed_to_it() -> None:
    assert parts(2.0, 3) == 6.0 + 8.0 + 1.0 + 1.0
    assert len(part.compiled.signatures) == 1


def test_once_runs_as_written_and_needs_no_numba() -> None:
    code = (
        "import sys; from magbend.core import jit; from magbend.core.jit import once\n"
        "from magbend.sim import UniformField, gmc, solve\n"
        "once(lambda: solve(gmc(2), UniformField(flux_mT=50.0)))\n"
        "assert 'numba' not in sys.modules\n"
        "jit.PLAIN_FIRST = False\n"
        "solve(gmc(2), UniformField(flux_mT=50.0))\n"
        "assert 'numba' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("patient", [True, False])
def test_first_calls_run_as_written_unless_told_otherwise(
    monkeypatch: pytest.MonkeyPatch, patient: bool
) -> None:
    monkeypatch.setattr(jit, "PLAIN_FIRST", patient)
    kernel = jit.Kernel(lambda x: x + 1.0, {})
    plain = []

    @jit.plain_first(kernel)
    def public(x: float) -> float:
        plain.append(jit._calls_left.get() is not None)
        return kernel(x)

    assert [public(float(i)) for i in range(jit.FIRST_CALLS + 2)][-1] == 22.0
    assert plain == [patient] * jit.FIRST_CALLS + [False] * 2


def test_long_work_goes_on_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "PATIENCE", 5)
    starts = []

    def task() -> float:
        starts.append(jit._calls_left.get() is not None)
        return power_sum(1.0, 8)

    assert once(task) == power_sum(1.0, 8)
    assert starts == [True, False]
    assert jit._calls_left.get() is None


def test_calls_go_straight_to_machine_code_but_within_once() -> None:
    kernel = jit.Kernel(lambda x: x + 1, {})
    assert kernel(1.0) == 2.0
    assert kernel.__call__ is kernel.compiled
    half = Fraction(1, 2)  # nothing that machine code takes
    assert once(lambda: kernel(half)) == half + 1
    other = threading.Thread(target=lambda: kernel(1.0))

    def task() -> Fraction:
        other.start()
        other.join()
        return kernel(half)

    assert once(task) == half + 1
    assert kernel(1.0) == 2.0
    assert kernel.__call__ is kernel.compiled


def test_what_python_refuses_is_left_to_machine_code() -> None:
    assert once(lambda: quotient(1.0, 0.0)) == math.inf
    assert once(lambda: quotient(np.float64(1.0), 0.0)) == math.inf


def test_python_says_no_more_of_what_is_empty_than_machine_code() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert math.isnan(once(lambda: float(np.nanmedian(np.full(3, np.nan)))))


def test_errors_of_the_task_itself_pass_through_and_leave_no_trace() -> None:
    def task() -> None:
        raise ValueError("mine")

    with pytest.raises(ValueError, match="mine"):
        once(task)
    assert jit._calls_left.get() is None


def test_other_threads_keep_machine_code() -> None:
    seen = []

    def task() -> None:
        worker = threading.Thread(
            target=lambda: seen.append(jit._calls_left.get() is None)
        )
        worker.start()
        worker.join()

    once(task)
    assert seen == [True]


def test_a_kernel_keeps_its_name_and_goes_to_other_processes() -> None:
    from magbend.sim.planar.follow import newton

    assert newton.__name__ == "newton"
    assert "equilibrium" in str(newton.__doc__)
    assert pickle.loads(pickle.dumps(newton)) is newton


INNER = """
from magbend.core.jit import njit
FACTOR = {factor}

@njit(cache=True)
def inner(x):
    return FACTOR * x
"""
OUTER = """
from inner import inner
from magbend.core.jit import njit

@njit(cache=True)
def outer(x):
    return inner(x) + 1.0

stored = outer.is_stored
print(stored, outer(1.0))
"""
ENDED = """
import os
from numba.core.caching import IndexDataCacheFile

IndexDataCacheFile._save_data = lambda *_: os._exit(3)
import outer
"""


def test_stored_code_is_not_used_once_a_kernel_it_holds_has_changed(
    tmp_path: Path,
) -> None:
    def run(factor: float) -> str:
        (tmp_path / "inner.py").write_text(INNER.format(factor=factor))
        done = subprocess.run(
            [sys.executable, "-B", tmp_path / "outer.py"],
            check=True, capture_output=True, text=True,
        )  # fmt: skip
        return done.stdout.strip()

    (tmp_path / "outer.py").write_text(OUTER)
    assert run(2.0) == "False 3.0"
    assert run(2.0) == "True 3.0"
    assert run(5.0) == "False 6.0"
    (tmp_path / "ended.py").write_text(ENDED)
    (tmp_path / "inner.py").write_text(INNER.format(factor=7.0))
    ended = subprocess.run([sys.executable, "-B", tmp_path / "ended.py"], check=False)
    assert ended.returncode == 3
    assert run(7.0).endswith("8.0")


WAITING = """
from outer import outer

outer.compiled
print("asks", flush=True)
outer(1.0)
(misses,) = outer.compiled.stats.cache_misses.values() or (0,)
print("compiled" if misses else "loaded")
"""


def test_of_processes_that_start_together_one_compiles(tmp_path: Path) -> None:
    (tmp_path / "inner.py").write_text(INNER.format(factor=2.0))
    (tmp_path / "outer.py").write_text(OUTER.partition("stored")[0])
    (tmp_path / "waiting.py").write_text(WAITING)
    command = [sys.executable, "-B", tmp_path / "waiting.py"]
    said = []
    with ExitStack() as stack:
        both = [
            stack.enter_context(
                subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            )
            for _ in range(2)
        ]
        said = sorted(one.communicate(timeout=120)[0].split()[-1] for one in both)
    assert said == ["compiled", "loaded"]


NOWHERE = """
import magbend.core.jit as jit
import numba.core.caching as caching

caching.CacheImpl._locator_classes = []
caching.CompileResultCacheImpl._locator_classes = []

@jit.njit(cache=True)
def twice(x):
    return 2.0 * x

print(twice(4.0), twice.is_stored)
"""


def test_kernels_run_where_nothing_may_be_written(tmp_path: Path) -> None:
    (tmp_path / "nowhere.py").write_text(NOWHERE)
    done = subprocess.run(
        [sys.executable, "-B", tmp_path / "nowhere.py"],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout.strip() == "8.0 False"


def test_a_kernel_that_was_only_looked_at_is_not_at_hand() -> None:
    kernel = jit.Kernel(lambda x: x + 1.0, {})
    assert not kernel.is_stored
    assert not kernel.is_at_hand  # else the next call would wait for the compiler
    assert kernel(1.0) == 2.0
    assert kernel.is_at_hand
