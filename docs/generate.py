"""Pages that are made, not written: commands, faces, gallery, drawings."""

from __future__ import annotations

import contextlib
import inspect
import io
import shutil
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import drawings

FACES = {
    "magbend.sim": "Rods, magnets and their equilibria",
    "magbend.sim.equilibria": "Every equilibrium of a rod, and folds",
    "magbend.vision": "Photographs to centrelines",
    "magbend.vision.synthetic": "Photographs with known truth",
    "magbend.rig": "Stage, camera, Tesla-meter, runs",
    "magbend.analysis": "Compare, fit, report, design",
    "magbend.core": "What the parts share",
}


def all_pages(out: Path) -> None:
    """Make every page anew."""
    shutil.rmtree(out, ignore_errors=True)
    (out / "api").mkdir(parents=True)
    drawings.all_drawings(out.parent / "pictures")
    (out / "commands.md").write_text(commands(), encoding="utf-8")
    told: set[int] = set()
    for face, title in FACES.items():
        page = out / "api" / f"{face}.rst"
        page.write_text(api(face, title, told), encoding="utf-8")
    (out / "gallery.md").write_text(gallery(out / "gallery"), encoding="utf-8")


def commands() -> str:
    """Return a page with the help of every command."""
    import click
    from typer.main import get_command

    from magbend.cli.main import app

    lines = ["# Every command", "", "`magbend COMMAND --help` prints the same.", ""]

    def add(command: click.Command, path: list[str]) -> None:
        with click.Context(command, info_name=" ".join(path)) as context:
            if not isinstance(command, click.Group):
                text = command.get_help(context)
                lines.extend([f"## {' '.join(path)}", "", "```text", text, "```", ""])
                return
            for name in command.list_commands(context):
                add(command.get_command(context, name), [*path, name])

    add(get_command(app), ["magbend"])
    return "\n".join(lines)


def api(face: str, title: str, told: set[int]) -> str:
    """Return a page with the docstrings of what a face exports and none before it."""
    module = import_module(face)
    lines = [title, "=" * len(title), "", f".. currentmodule:: {face}", ""]
    for name in sorted(module.__all__, key=str.lower):
        value = getattr(module, name)
        if id(value) in told:
            continue
        told.add(id(value))
        if isinstance(value, type):
            lines += [f".. autoclass:: {face}.{name}", "   :members:", ""]
        elif inspect.isroutine(value):
            lines += [f".. autofunction:: {face}.{name}", ""]
    plain = [n for n in module.__all__ if _is_plain(getattr(module, n))]
    if plain:
        lines += ["Constants", "---------", ""]
        for name in sorted(plain):
            lines.append(f"* ``{name}`` = ``{_short(getattr(module, name))}``")
    return "\n".join(lines) + "\n"


def _is_plain(value: object) -> bool:
    return not isinstance(value, type) and not inspect.isroutine(value)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) < 80 else text[:77] + "..."


def gallery(folder: Path) -> str:
    """Run every example; return a page with what each draws and prints."""
    import matplotlib as mpl

    mpl.use("Agg")
    folder.mkdir(parents=True)
    examples = Path(__file__).resolve().parents[1] / "examples"
    sys.path.insert(0, str(examples))
    lines = ["# Gallery", "", "Each figure is drawn by the script above it.", ""]
    for script in sorted(examples.glob("[!_]*.py")):
        module: Any = import_module(script.stem)
        if not hasattr(module, "main"):
            continue
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            module.main(folder)
        title = (module.__doc__ or script.stem).strip().splitlines()[0]
        lines += [f"## {title}", "", f"`examples/{script.name}`", "", "```python"]
        lines += [script.read_text(encoding="utf-8").rstrip(), "```", ""]
        for kind in (".svg", ".png", ".gif"):
            for figure in sorted(folder.glob(f"{script.stem}*{kind}")):
                lines += [f"![{title}](gallery/{figure.name})", ""]
    return "\n".join(lines)
