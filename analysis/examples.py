"""The examples and input files that come with the package, copied to a folder."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from ..core.errors import StoreError
from ..core.files import write_bytes

FOLDERS = {
    "magbend.examples": "",
    "magbend.examples.plans": "plans",
    "magbend.examples.specimens": "specimens",
    "magbend.examples.library": "library",
    "magbend.examples.lumens": "lumens",
}
KINDS = (".py", ".md", ".toml", ".csv", ".ipynb")
PHOTOGRAPHS = "photographs"
"""A board and rods before the same camera, and what is true of each."""


def copy_examples(folder: Path) -> list[Path]:
    """Copy scripts, input files and photographs; return where they lie.

    Parameters
    ----------
    folder : Path
        Where to; it is made. What is there already stays as it is.

    Raises
    ------
    StoreError
        If one of the files exists already.
    """
    copies = {}
    for package, inside in FOLDERS.items():
        for entry in resources.files(package).iterdir():
            if entry.name.endswith(KINDS) and entry.name != "__init__.py":
                copies[folder / inside / entry.name] = entry.read_bytes()
    for entry in (resources.files("magbend.examples") / PHOTOGRAPHS).iterdir():
        copies[folder / PHOTOGRAPHS / entry.name] = entry.read_bytes()
    for path in sorted(copies):
        if path.exists():
            raise StoreError(f"{path} is there already; name another folder")
    for path, data in copies.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, data)
    return sorted(copies)
