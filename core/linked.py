"""Numba's code libraries, but machine code only of what is called from Python.

What one kernel calls of another is linked into it as LLVM's bitcode and compiled there.
Numba makes machine code of each link of such a chain, and of all that hangs on it,
although nothing but the kernel that Python calls is ever run.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
from numba import version_info
from numba.core.codegen import JITCodeLibrary
from numba.core.environment import lookup_environment

TRIED = {(0, 68)}
"""Versions of numba whose privates are known here; by others, all is machine code."""

_WRAPPER = "_ZN7cpython"
"""How the names of functions begin through which Python calls a kernel."""


class LinkedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """A code library that has no machine code until Python calls into it."""

    is_emitted = False

    def _finalize_final_module(self) -> None:
        if self._disable_inspection:  # it is machine code, from the cache
            self.emit()
        else:
            self._finalize_dynamic_globals()
            self._finalized = True

    def _optimize_final_module(self) -> None:
        """Inline what is small: the rest is optimised where it becomes machine code."""
        manager, builder = self._codegen._module_pass_manager(
            loop_vectorize=self._codegen._loopvect, slp_vectorize=False,
            opt=self._codegen._opt_level, cost="cheap",
        )  # fmt: skip
        manager.run(self._final_module, builder)

    def emit(self) -> None:
        """Make machine code."""
        if self.is_emitted:
            return
        self.is_emitted = True
        if not self._disable_inspection:
            super()._optimize_final_module()
        module = self._final_module
        environments = [x.name for x in module.global_variables if not x.is_declaration]
        super()._finalize_final_module()
        for name in environments:
            environment = lookup_environment(name)
            if environment is not None:
                self.set_env(name, environment)

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function; zero for what Python does not call."""
        self._ensure_finalized()
        if name.startswith(_WRAPPER) and not self.is_emitted:
            return 0
        self.emit()
        return int(super().get_pointer_to_function(name))

    @property
    def codegen(self) -> Any:
        """What sets environments."""
        return weakref.proxy(self)

    def set_env(self, name: str, environment: Any) -> None:
        """Let machine code know its environment."""
        if self.is_emitted:
            self._codegen.set_env(name, environment)

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """Return what is kept in the cache."""
        if self.is_emitted:
            return super().serialize_using_object_code()  # type: ignore[no-any-return]
        return self.name, "linked", self._final_module.as_bitcode()

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> Any:
        name, kind, data = state
        if kind != "linked":
            return super()._unserialize(codegen, state)
        self = codegen.create_library(name)
        self.enable_object_caching()
        self._final_module = llvm.parse_bitcode(data)
        self._finalize_final_module()
        return self


@contextmanager
def linked(compiled: Any) -> Iterator[bool]:
    """Compile for other kernels; tell whether it is Python that asks for it.

    Parameters
    ----------
    compiled : numba.core.dispatcher.Dispatcher
        The one that is about to compile.
    """
    compiled.targetctx.refresh()  # numba's own library of memory is to be emitted
    codegen = compiled.targetctx.codegen()
    before = codegen._library_class
    if version_info.short in TRIED:
        codegen._library_class = LinkedLibrary
    try:
        yield codegen._library_class is not before
    finally:
        codegen._library_class = before


def has_code(library: Any) -> bool:
    """Whether a code library is machine code, and not only linked into others."""
    return not isinstance(library, LinkedLibrary) or library.is_emitted
