"""Sobol indices against what the physics demands."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.analysis.surrogate.sobol import OUTPUTS, PARAMETERS, sensitivity
from magbend.core.errors import InputError


@pytest.fixture(scope="module")
def found():
    return sensitivity(fields_mT=(2.0, 120.0), samples=512)


def index(found, field, output, parameter):
    j, k = OUTPUTS.index(output), list(PARAMETERS).index(parameter)
    return found.total[field, j, k]


def test_in_a_weak_field_the_form_does_not_know_the_load(found):
    # Small bends are linear: shape / size depends on ratios of moduli and lengths only.
    for parameter in ("E root", "side", "remanence"):
        assert index(found, 0, "circularity", parameter) < 1e-3
    assert index(found, 1, "circularity", "E root") > 0.1


def test_the_root_matters_most_for_the_radius(found):
    j = OUTPUTS.index("radius_mm")
    for field in range(2):
        assert np.argmax(found.total[field, j]) == list(PARAMETERS).index("E root")


def test_alone_is_not_more_than_with_interactions(found):
    assert np.all(found.first <= found.total + 0.08)
    assert np.all(found.total_sd >= 0.0)
    assert len(found.rows()) == 2 * len(OUTPUTS) * len(PARAMETERS)


def test_a_field_of_zero_is_refused():
    with pytest.raises(InputError, match="above zero"):
        sensitivity(fields_mT=(0.0,))
