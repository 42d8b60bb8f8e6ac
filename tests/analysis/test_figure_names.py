"""A name of a run is text: in ids, in figures, in file names."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest
from matplotlib.figure import Figure

from magbend.analysis.figures.style import drawing, safe_name, to_svg

HOSTILE = ['run"><img src=x onerror=alert(1)>', "$\\frac$", "a/../b", "é ü", "run_1"]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_name_stays_text_in_a_figure(name):
    with drawing():
        figure = Figure(figsize=(4.0, 3.0))
        axes = figure.subplots()
        axes.plot([0, 1], [0, 1], label=name)
        axes.set_title(name)
        axes.legend()
    svg = to_svg(figure, name)
    tree = ET.fromstring(svg.replace("xlink:", ""))  # well formed: nothing broke out
    ids = [one.get("id") for one in tree.iter() if one.get("id")]
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]+", one) for one in ids)
    assert "<img" not in svg
    assert name in "".join(tree.itertext())


def test_safe_names_are_plain_and_stay_apart():
    assert safe_name("run_1-a") == "run_1-a"
    names = {safe_name(one) for one in [*HOSTILE, "a b", "a-b", "a/b"]}
    assert len(names) == len(HOSTILE) + 3
    assert all(re.fullmatch(r"[A-Za-z0-9_-]+", one) for one in names)
