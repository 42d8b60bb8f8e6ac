"""How the site is built: ``make docs``.

Pages are Markdown (MyST). What would go stale by hand is made here before each build,
into ``docs/made/``: the reference of commands from the command line itself, one page
a face from its docstrings, the gallery from the examples; and the drawings, into
``docs/pictures/``, where they are committed.
"""

from __future__ import annotations

import sys
from importlib.metadata import version as installed
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

project = "magbend"
author = "The magbend developers"
copyright = "the magbend developers"
version = release = installed("magbend")

extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["site", "decisions/README.md"]
suppress_warnings = ["misc.highlighting_failure"]

autodoc_typehints = "none"  # the docstrings say types, shapes and units
autodoc_member_order = "alphabetical"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "furo"
html_title = f"magbend {release}"
html_copy_source = False


def setup(app: object) -> None:
    """Make what is made before anything is read."""
    import generate

    app.connect("builder-inited", lambda _: generate.all_pages(HERE / "made"))  # type: ignore[attr-defined]
