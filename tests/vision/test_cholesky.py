"""The small systems of the curve fit against numpy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magbend.vision.curve.cholesky import factor, inverse, solved, solved_half, squared
from magbend.vision.curve.robust import median, quantile, quantiles


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 40), st.integers(0, 100))
def test_systems_are_solved_as_numpy_solves_them(size, seed):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(size + 5, size))
    matrix, right = rows.T @ rows + 0.1 * np.eye(size), rng.normal(size=size)
    upper = factor(matrix)
    np.testing.assert_allclose(upper, np.linalg.cholesky(matrix).T, atol=1e-10)
    exact = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(solved(upper, right), exact, atol=1e-9)
    half = solved_half(upper, right)
    assert half @ half == pytest.approx(right @ exact, rel=1e-9)
    np.testing.assert_allclose(inverse(upper) @ upper, np.eye(size), atol=1e-9)
    np.testing.assert_allclose(squared(upper), upper @ upper.T, atol=1e-9)


def test_what_has_no_factor_is_nan():
    assert np.isnan(factor(np.array([[1.0, 2.0], [2.0, 1.0]]))).any()


def test_medians_leave_nan_out():
    values = np.array([np.nan, 3.0, 1.0, 2.0, np.nan, 10.0])
    assert median(values) == 2.5
    assert quantile(values, 0.5) == 2.5
    assert quantile(values, 1.0) == 10.0
    assert np.isnan(median(values[:1]))
    assert np.isnan(quantile(values[:0], 0.5))


def test_quantiles_of_rows_are_those_of_each():
    rows = np.random.default_rng(2).normal(size=(5, 40))
    rows[2, ::3] = np.nan
    each = [quantile(row, 0.25) for row in rows]
    np.testing.assert_array_equal(quantiles(rows, 0.25), each)
