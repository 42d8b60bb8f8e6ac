"""Conditions typed by people, as Arrow expressions: a small, closed language.

``tip_y_mm > 4 and side_mm <= 1``, ``10 < radius_mm < 50 or status != "stable"``,
``not flux_mT in (10, 20)``, ``E1_MPa / E3_MPa > 2``, ``abs(tip_y_mm - 5) < 0.1``,
``length1_mm + length2_mm == 20``, ``total_length_mm == 30``. Only columns, numbers,
strings, comparisons, logic, the four operations and abs: nothing is evaluated as
Python. What is computed counts as equal within a millionth.
"""

from __future__ import annotations

import ast
import difflib
import functools
import math
import operator
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeGuard

from ...core.errors import InputError

_COMPARE = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge, ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip


_OPERATIONS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}  # fmt: skip
TOTAL = "total_length_mm"
"""The sum of the sections' lengths: a column that no library holds."""

_BEYOND_INT = 2**63  # Arrow's whole numbers end there
NEAR = 1e-6
"""Within which computed numbers are equal."""


def parse_where(text: str, columns: Sequence[str]) -> Any:
    """Return the Arrow expression of a ``--where`` condition.

    Raises
    ------
    InputError
        If it is no condition, or names a column that the library does not have.
    """
    must = "--where must be a condition such as 'tip_y_mm > 4 and side_mm < 1'"
    return _node(_tree(text, must), columns, text)


def parse_value(text: str, columns: Sequence[str]) -> Any:
    """Return the Arrow expression of a number computed from columns.

    Raises
    ------
    InputError
        If it is none, or names a column that the library does not have.
    """
    must = (
        "a key must be a column or a number computed from columns, such as "
        "E1_MPa/E3_MPa"
    )
    return _value(_tree(text, must), columns, text)


def parse_range(text: str, columns: Sequence[str]) -> Any:
    """Return the Arrow expression of a ``--range KEY=LOW:HIGH``; an end may be empty.

    Raises
    ------
    InputError
        If it is no range, or is empty, or the column is not known.
    """
    import pyarrow.dataset as ds

    name, equals, ends = text.partition("=")
    low_text, colon, high_text = ends.partition(":")
    try:
        low = float(low_text) if low_text.strip() else -math.inf
        high = float(high_text) if high_text.strip() else math.inf
    except ValueError:
        low = high = math.nan
    if not equals or not colon or not low <= high:
        raise InputError(
            "--range must be KEY=LOW:HIGH with LOW not above HIGH, such as "
            f"tip_y_mm=4:6; instead received {text!r}"
        )
    field = ds.field(known(name.strip(), columns))
    return (field >= low) & (field <= high)


def known(name: str, columns: Sequence[str]) -> str:
    """Return `name` if it is a column.

    Raises
    ------
    InputError
        If it is not, with the nearest name.
    """
    if name in columns:
        return name
    close = difflib.get_close_matches(name, columns, n=1, cutoff=0.5)
    hint = f"did you mean {close[0]!r}?" if close else f"there are {', '.join(columns)}"
    raise InputError(f"the library has no column {name!r}; {hint}")


def all_of(expressions: Iterable[Any]) -> Any:
    """Return the conjunction of expressions, None of none."""
    joined = None
    for expression in expressions:
        joined = expression if joined is None else joined & expression
    return joined


def _tree(text: str, must: str) -> ast.expr:
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError):
        raise InputError(f"{must}; instead received {text!r}") from None


def _node(node: ast.expr, columns: Sequence[str], text: str) -> Any:
    if isinstance(node, ast.BoolOp):
        parts = [_node(value, columns, text) for value in node.values]
        joined = parts[0]
        for part in parts[1:]:
            joined = joined & part if isinstance(node.op, ast.And) else joined | part
        return joined
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return ~_node(node.operand, columns, text)
    if isinstance(node, ast.Compare):
        return _comparison(node, columns, text)
    raise InputError(f"--where cannot use {ast.unparse(node)!r} in {text!r}")


def _comparison(node: ast.Compare, columns: Sequence[str], text: str) -> Any:
    parts = []
    left = node.left
    for op, right in zip(node.ops, node.comparators, strict=True):
        if isinstance(op, ast.In) and isinstance(right, (ast.Tuple, ast.List)):
            values = [_value(item, columns, text) for item in right.elts]
            parts.append(_value(left, columns, text).isin(values))
        elif type(op) in _COMPARE:
            pair = _value(left, columns, text), _value(right, columns, text)
            computed = isinstance(op, (ast.Eq, ast.NotEq)) and (
                _is_computed(left) or _is_computed(right)
            )
            parts.append(
                _near(*pair, isinstance(op, ast.Eq))
                if computed
                else _COMPARE[type(op)](*pair)
            )
        else:
            raise InputError(f"--where cannot use {ast.unparse(node)!r} in {text!r}")
        left = right
    if any(isinstance(part, bool) for part in parts):
        raise InputError(f"--where compares no column in {ast.unparse(node)!r}")
    return all_of(parts)


def _is_computed(node: ast.expr) -> bool:
    name = isinstance(node, ast.Name) and node.id == TOTAL
    return name or isinstance(node, (ast.BinOp, ast.Call))


def _is_abs(node: ast.expr) -> TypeGuard[ast.Call]:
    call = isinstance(node, ast.Call) and ast.unparse(node.func) == "abs"
    return call and len(node.args) == 1 and not node.keywords  # type: ignore[attr-defined]


def _is_constant(node: ast.expr) -> TypeGuard[ast.Constant]:
    value = node.value if isinstance(node, ast.Constant) else None
    if type(value) is int:
        return abs(value) < _BEYOND_INT
    return type(value) in (float, str)


def _near(left: Any, right: Any, equal: bool) -> Any:
    import pyarrow.compute as pc

    off = pc.abs(pc.subtract(left, right))
    return off <= NEAR if equal else off > NEAR


def _is_plain(value: Any) -> bool:
    return isinstance(value, (int, float))


def _total(columns: Sequence[str]) -> Any:
    """Return the length of the whole rod."""
    import pyarrow.dataset as ds

    lengths = [ds.field(name) for name in columns if name.startswith("length")]
    return functools.reduce(operator.add, lengths)


def _value(node: ast.expr, columns: Sequence[str], text: str) -> Any:
    import pyarrow.compute as pc
    import pyarrow.dataset as ds

    if isinstance(node, ast.Name):
        if node.id == TOTAL and TOTAL not in columns:
            return _total(columns)
        return ds.field(known(node.id, columns))
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        sides = [_value(side, columns, text) for side in (node.left, node.right)]
        if any(isinstance(side, str) for side in sides):
            raise InputError(f"--where cannot compute {ast.unparse(node)!r}")
        # Whole numbers would be divided without their rest.
        left, right = (pc.scalar(float(s)) if _is_plain(s) else s for s in sides)
        if isinstance(node.op, ast.Div) and _is_plain(sides[1]) and sides[1] == 0.0:
            raise InputError(f"--where divides by zero in {ast.unparse(node)!r}")
        return _OPERATIONS[type(node.op)](left, right)
    if _is_abs(node):
        value = _value(node.args[0], columns, text)
        return abs(value) if _is_plain(value) else pc.abs(value)
    if _is_constant(node):
        return node.value
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        value = _value(node.operand, columns, text)
        if isinstance(value, (int, float)):
            return -value if isinstance(node.op, ast.USub) else value
        if not isinstance(value, str):
            return value * (-1.0 if isinstance(node.op, ast.USub) else 1.0)
    raise InputError(f"--where cannot use {ast.unparse(node)!r} in {text!r}")
