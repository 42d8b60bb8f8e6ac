"""The examples in docstrings run and print what they say."""

from __future__ import annotations

import doctest
import importlib

import pytest
from house import PACKAGES, ROOT, files, module_of

WITH_EXAMPLES = [
    "magbend." + ".".join(module_of(path))
    for package in PACKAGES
    if (ROOT / package).is_dir()
    for path in files(package)
    if ">>>" in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_of(name: str) -> None:
    module = importlib.import_module(name)
    outcome = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert outcome.attempted
    assert outcome.failed == 0
