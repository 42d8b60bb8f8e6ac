"""Do the tests notice? Break one place at a time, and see whether a test fails.

``make mutants`` (``python tests/mutants.py --count 12 --seed 1``) draws places at
random from sim, vision, rig and analysis, changes each in an installed copy (an
operator, a comparison, a number, a truth value), runs the tests that stand nearest to
it, then those of its package, and prints what survived. The seed is printed: the same
seed draws the same places of the same sources.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from house import ROOT, files, module_of

PACKAGES = ("sim", "vision", "rig", "analysis")
COPY = ROOT / "build" / "mutants"
TIMEOUT_S = 600.0
SMALL = 1e-5

SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change: the text of `path` from `start` to `end` becomes `text`."""

    path: Path
    line: int
    start: int
    end: int
    text: str
    what: str


def mutants_of(path: Path) -> list[Mutant]:
    """Every change that is tried in a file."""
    source = path.read_text(encoding="utf-8")
    offsets = [0]
    for line in source.encode().splitlines(keepends=True):
        offsets.append(offsets[-1] + len(line))
    found = []
    for node in _running(ast.parse(source)):
        changed = _changed(node)
        if changed is None:
            continue
        start = offsets[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]
        end = offsets[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]
        old = source.encode()[start:end].decode()
        what = f"{old} -> {changed}"
        found.append(Mutant(path, node.lineno, start, end, f"({changed})", what))  # type: ignore[attr-defined]
    return found


def _running(tree: ast.AST) -> Iterator[ast.AST]:
    """Walk what runs: no decorators, no types, no inside of an f-string."""
    for name, value in ast.iter_fields(tree):
        if name in {"decorator_list", "annotation", "returns", "type_params"}:
            continue
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.AST) and not isinstance(node, ast.JoinedStr):
                yield node
                yield from _running(node)


def _changed(node: ast.AST) -> str | None:
    """Return the changed source of a node, or None where nothing is tried."""
    if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in SWAPS:
        return _with(node, op=SWAPS[type(node.op)]())
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        return _with(node, ops=[SWAPS[type(node.ops[0])]()])
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return ast.unparse(node.operand)
    if isinstance(node, ast.Constant):
        if isinstance(node.value, bool):
            return str(not node.value)
        if isinstance(node.value, int):
            return str(node.value + 1)
        if isinstance(node.value, float):
            # A tolerance doubled is as good; a thousandfold one is another promise.
            factor = 2.0 if node.value > SMALL else 1e3
            return repr(factor * node.value if node.value else 1.0)
    return None


def _with(node: ast.AST, **changes: object) -> str:
    fields = dict(ast.iter_fields(node)) | changes
    return ast.unparse(type(node)(**fields))


def draw(count: int, seed: int) -> list[Mutant]:
    """Draw places: a package, a file by its size, a place, each at random."""
    chance = random.Random(seed)
    places = {p: [m for f in files(p) for m in mutants_of(f)] for p in PACKAGES}
    return [chance.choice(places[PACKAGES[i % len(PACKAGES)]]) for i in range(count)]


def install() -> None:
    """Install a copy of the package to break; its kernels stay compiled meanwhile."""
    shutil.rmtree(COPY, ignore_errors=True)
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
    subprocess.run([*command, "--target", COPY, ROOT], check=True)


def nearest(mutant: Mutant) -> list[list[str]]:
    """Test files that name the module, then all of the package, as two rounds."""
    name = "magbend." + ".".join(module_of(mutant.path))
    package = module_of(mutant.path)[0]
    folder = ROOT / "tests" / package
    near = [
        str(path)
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
        if name in path.read_text(encoding="utf-8")
    ]
    return [near, [str(folder)]] if near else [[str(folder)]]


def survives(mutant: Mutant) -> bool:
    """Break the copy, run the tests, mend it; return whether all passed."""
    target = COPY / "magbend" / mutant.path.relative_to(ROOT)
    intact, times = target.read_bytes(), target.stat()
    broken = intact[: mutant.start] + mutant.text.encode() + intact[mutant.end :]
    target.write_bytes(broken)
    try:
        return all(_passes(tests) for tests in nearest(mutant))
    finally:
        target.write_bytes(intact)
        os.utime(target, ns=(times.st_atime_ns, times.st_mtime_ns))


def _passes(tests: list[str]) -> bool:
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    environment = {**os.environ, "PYTHONPATH": str(COPY)}
    try:
        done = subprocess.run(
            [*command, *tests],
            cwd=ROOT, env=environment, capture_output=True, check=False,
            timeout=TIMEOUT_S,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return False  # a loop that no longer ends is noticed
    return done.returncode == 0


def main() -> None:
    """Draw, break, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument(
        "--seed", type=int, default=random.SystemRandom().randrange(10**6)
    )
    asked = parser.parse_args()
    drawn = draw(asked.count, asked.seed)
    install()
    for package in sorted({module_of(mutant.path)[0] for mutant in drawn}):
        if not _passes([str(ROOT / "tests" / package)]):
            sys.exit(f"tests/{package} fail on the unbroken copy: mend them first")
    alive = 0
    for number, mutant in enumerate(drawn, start=1):
        lives = survives(mutant)
        alive += lives
        where = f"{mutant.path.relative_to(ROOT)}:{mutant.line}"
        fate = "SURVIVED" if lives else "caught"
        print(f"{number:3} {fate:8} {where}: {mutant.what}", flush=True)
    caught = asked.count - alive
    print(f"seed {asked.seed}: {caught} of {asked.count} caught, {alive} survived")


if __name__ == "__main__":
    main()
