"""The house as its imports draw it: rooms, arrows, floors, circles, arrows back.

``python tests/house.py`` prints one line a package; the tests hold it to no circle.
A room is a file or sub-package directly inside a package, an arrow an import between
two of them, a circle a set of rooms that reach each other. A floor is one more than
the highest floor a room imports from (a circle counts as one room).
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("core", "sim", "vision", "rig", "analysis", "panel", "cli")

Graph = dict[str, set[str]]


def files(package: str) -> list[Path]:
    """Python files of a package."""
    return sorted((ROOT / package).rglob("*.py"))


def module_of(path: Path) -> tuple[str, ...]:
    """Name of a file's module below ``magbend``, as its parts."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


def imports(path: Path, known: set[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Modules that a file imports, within functions too, but not for types alone."""
    module = module_of(path)
    here = module if path.name == "__init__.py" else module[:-1]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in _running(tree):
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.level:
            base = here[: len(here) - node.level + 1]
            base += tuple((node.module or "").split(".")) if node.module else ()
        elif (node.module or "").startswith("magbend."):
            base = tuple(str(node.module).split("."))[1:]
        else:
            continue
        for name in node.names:
            yield (*base, name.name) if (*base, name.name) in known else base


def _running(tree: ast.AST) -> Iterator[ast.AST]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        yield node
        yield from _running(node)


def file_graph(package: str) -> Graph:
    """Which file of a package imports which, by dotted names; faces left out."""
    paths = files(package)
    known = {module_of(path) for path in paths}
    plain = {module_of(p) for p in paths if p.name != "__init__.py"}
    graph: Graph = {".".join(module): set() for module in plain}
    for path in paths:
        if path.name == "__init__.py":
            continue
        module = ".".join(module_of(path))
        seen = {name for name in imports(path, known) if name in plain}
        graph[module] |= {".".join(name) for name in seen} - {module}
    return graph


def room_graph(package: str) -> Graph:
    """Which room directly inside a package imports which."""
    depth = len(package.split("/")) + 1
    rooms: Graph = {}
    for name, others in file_graph(package).items():
        room = ".".join(name.split(".")[:depth])
        rooms.setdefault(room, set())
        rooms[room] |= {".".join(other.split(".")[:depth]) for other in others}
    return {room: others - {room} for room, others in rooms.items()}


def circles(graph: Graph) -> list[list[str]]:
    """Sets of two or more nodes that reach each other (Tarjan 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph.get(node, ())):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def floors(graph: Graph) -> int:
    """How many floors a graph without circles has."""
    height: dict[str, int] = {}

    def up(node: str) -> int:
        if node not in height:
            height[node] = 1  # a circle ends here
            height[node] = 1 + max((up(n) for n in graph.get(node, ())), default=0)
        return height[node]

    return max((up(node) for node in graph), default=0)


def main() -> None:
    """Print the table."""
    print("package    rooms arrows floors circles  files lines")
    for package in PACKAGES:
        if not (ROOT / package).is_dir():
            continue
        rooms, by_file = room_graph(package), file_graph(package)
        lines = sum(
            len(p.read_text(encoding="utf-8").splitlines()) for p in files(package)
        )
        print(
            f"{package:10} {len(rooms):5} {sum(map(len, rooms.values())):6} "
            f"{floors(rooms):6} {len(circles(rooms)):7} {len(by_file):6} {lines:5}"
        )
        for circle in circles(rooms) + circles(by_file):
            print("   circle:", " <-> ".join(circle))


if __name__ == "__main__":
    main()
