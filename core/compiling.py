"""Save numba work: one version of a kernel, compiled by one process, without pauses."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from numba.core import sigutils
from numba.core.compiler_lock import global_compiler_lock
from numba.core.types import BooleanLiteral, IntegerLiteral

from .linked import has_code, linked


def spare(compiled: Any) -> None:
    """Make a dispatcher compile less often, and quicker.

    Parameters
    ----------
    compiled : numba.core.dispatcher.Dispatcher
        What `numba.njit` returns.
    """
    compile_, add_overload = compiled.compile, compiled.add_overload
    template = compiled.get_call_template

    def compile_in_turn(signature: Any) -> Any:
        kinds = tuple(sigutils.normalize_signature(signature)[0])
        with (
            global_compiler_lock,
            _own_turn(compiled),
            _no_collection(),
            linked(compiled) as is_for_python,
        ):
            compile_(signature)
            result = compiled.overloads[kinds]
            if is_for_python and not has_code(result.library):
                result = _emitted(compiled, result)
                add_overload(result)
                compiled._cache.save_overload(signature, result)
        return result.entry_point

    def add(result: Any) -> None:
        if has_code(result.library):
            add_overload(result)
        else:  # nothing that could be called yet
            compiled.overloads[tuple(result.signature.args)] = result

    def get_call_template(args: Any, kws: dict[str, Any]) -> Any:
        named = {name: _plain(kind) for name, kind in kws.items()}
        return template(tuple(map(_plain, args)), named)

    compiled.compile = compile_in_turn
    compiled.add_overload = add
    compiled.get_call_template = get_call_template


def _emitted(compiled: Any, result: Any) -> Any:
    """Return what was compiled for other kernels, for Python too."""
    context, library = compiled.targetctx, result.library
    library.emit()
    entry = context.get_executable(library, result.fndesc, result.environment)
    context.insert_user_function(entry, result.fndesc, [library])
    return result._replace(entry_point=entry)


def _plain(kind: Any) -> Any:
    """Return the type of a number that a call writes out: it is worth no version."""
    is_written = isinstance(kind, IntegerLiteral | BooleanLiteral)
    return kind.literal_type if is_written else kind


@contextmanager
def _own_turn(compiled: Any) -> Iterator[None]:
    """Let one process compile what others load.

    Processes that start together would each compile the same, and write over what the
    others noted in the kernel's index.
    """
    file = getattr(compiled._cache, "_cache_file", None)
    with ExitStack() as held:
        if file is not None and not compiled._compiling_counter:
            with suppress(ImportError, OSError):  # a system or disk without locks
                from fcntl import LOCK_EX, flock

                lock = held.enter_context(Path(f"{file._index_path}.lock").open("w"))
                flock(lock, LOCK_EX)
        yield


@contextmanager
def _no_collection() -> Iterator[None]:
    """Leave what numba builds uncollected: most lives on, and looking takes a tenth."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
