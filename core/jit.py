"""Kernels: functions on arrays that numba compiles, or that run as they are written.

Machine code is a thousand times as fast as Python, but importing numba and loading the
code it keeps takes half a second, and compiling it a minute. A process that solves one
rod and ends is done sooner in plain Python: it puts its task through `once`. Everyone
else calls kernels and gets machine code.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import itertools
import os
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from types import CodeType
from typing import Any, TypeVar, cast

Result = TypeVar("Result")
Function = TypeVar("Function", bound=Callable[..., Any])

PATIENCE = 5_000
"""Calls of kernels, a few tenths of a second, after which a task goes on compiled."""

PLAIN_FIRST = True
"""Whether what is not compiled yet runs as plain Python at first.

Else it is compiled when it is called: who calls everything many times is done sooner.
"""
FIRST_CALLS = 20
"""Calls of a public function that run as plain Python before anything is compiled."""
MOST = 50_000
"""Calls of kernels, about a second, that such a call may take."""

_LOCK = threading.RLock()
_calls_left: ContextVar[list[int] | None] = ContextVar("calls_left", default=None)
_direct: list[Kernel] = []
"""Kernels whose calls go to numba's dispatcher: none while a task runs as written."""
_as_written = 0
"""Tasks that do, in any thread."""


class _Unfit(BaseException):
    """Plain Python takes too long, or refuses what machine code computes."""


class Kernel:
    """A function compiled when it is first called, or needed by another kernel.

    Parameters
    ----------
    function : callable
        What to compile.
    options : dict
        Of `numba.njit`.
    """

    # Looked up by C in a slot: a method of Python's own doubles the cost of a call.
    __slots__ = ("__call__", "__dict__")
    __call__: Callable[..., Any]
    __name__: str

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.__call__ = self._called
        self._function = function
        self._options = options
        self._compiled: Any = None

    @property
    def compiled(self) -> Any:
        """Numba's dispatcher of the function."""
        if self._compiled is None:
            with _LOCK:
                if self._compiled is None:
                    self._compiled = self._compile()
        return self._compiled

    def _compile(self) -> Any:
        from numba import njit as numba_njit

        options = self._options
        try:
            compiled = numba_njit(**options)(self._function)
        except RuntimeError as error:
            if "no locator available" not in str(error):
                raise
            # Neither beside the source nor in the home can anything be written.
            options = {**options, "cache": False}
            compiled = numba_njit(**options)(self._function)
        compiled.get_call_template = _by_kind(compiled)
        if options.get("cache"):
            file = compiled._cache._cache_file
            file._source_stamp = (file._source_stamp, self.fingerprint)
            compiled.compile = _one_at_a_time(compiled)
        return compiled

    @functools.cached_property
    def fingerprint(self) -> str:
        """Digest of the function and of all kernels and constants that it uses.

        Numba takes its stored machine code for fresh while the file of the function is
        unchanged, although it holds the kernels of other files too.
        """
        digest = hashlib.sha256()
        for code in _codes(self._function.__code__):
            digest.update(code.co_code + repr(_plain(code.co_consts)).encode())
            for name in code.co_names:
                value = self._function.__globals__.get(name)
                if isinstance(value, Kernel) and value is not self:
                    value = value.fingerprint
                digest.update(f"{name} {_plain((value,))}".encode())
        return digest.hexdigest()

    @property
    def cache_folder(self) -> str:
        """Where machine code is kept; empty if nothing can be written."""
        return str(getattr(self.compiled._cache, "cache_path", None) or "")

    @property
    def is_stored(self) -> bool:
        """Whether machine code of this very kernel waits in numba's cache."""
        file = getattr(self.compiled._cache, "_cache_file", None)
        return file is not None and bool(file._load_index())

    @property
    def is_at_hand(self) -> bool:
        """Whether machine code is loaded, or seems to wait in the usual place.

        Without a look by numba, whose import takes longer than a first solve.
        """
        if self._compiled is not None and self._compiled.signatures:
            return True
        code = self._function.__code__
        source = Path(os.environ.get("NUMBA_CACHE_DIR") or code.co_filename)
        if source.is_dir():
            return self.is_stored
        name = f"{source.stem}.{self._function.__name__}-{code.co_firstlineno}."
        return any(source.parent.glob(f"__pycache__/{name}*.nbi"))

    @property
    def targetoptions(self) -> dict[str, Any]:
        """Options in which numba finds that a kernel is written into its caller.

        What one kernel alone calls is compiled once more with it: `inline="always"`
        saves the first time.
        """
        return self._options

    @property
    def py_func(self) -> Callable[..., Any]:
        """What numba writes into the caller."""
        return self._function

    @property
    def _numba_type_(self) -> Any:
        """What numba takes this for where another kernel calls it."""
        return self.compiled._numba_type_

    def __reduce__(self) -> str:
        """Pickle as the name that another process imports."""
        return self._function.__qualname__

    def _called(self, *args: Any) -> Any:
        """Run compiled, from now on directly; or, within `once`, as written."""
        left = _calls_left.get()
        if left is None:
            compiled = self.compiled
            with _LOCK:
                if not _as_written:
                    self.__call__ = compiled
                    _direct.append(self)
            return compiled(*args)
        left[0] -= 1
        if left[0] < 0:
            raise _Unfit
        try:
            return self._function(*args)
        except (ArithmeticError, ValueError):
            # 1 / 0 and sqrt(-1) are numbers to machine code.
            raise _Unfit from None


def _by_kind(compiled: Any) -> Callable[[Any, Any], Any]:
    """Return a dispatcher's `get_call_template` that takes a constant for a variable.

    Numba would compile a kernel anew for each constant that another one hands it.
    """
    from numba.core.types.misc import unliteral

    get_call_template = compiled.get_call_template

    def get_by_kind(args: Any, options: Any) -> Any:
        kinds = {name: unliteral(kind) for name, kind in options.items()}
        return get_call_template(tuple(map(unliteral, args)), kinds)

    return get_by_kind


def _one_at_a_time(compiled: Any) -> Callable[[Any], Any]:
    """Return a dispatcher's `compile` that lets one process compile what others load.

    Processes that start together would each compile the same, and write over what the
    others noted in the kernel's index.
    """
    from numba.core.compiler_lock import global_compiler_lock

    compile_, file = compiled.compile, compiled._cache._cache_file

    def compile_in_turn(signature: Any) -> Any:
        with global_compiler_lock, _no_collection(), ExitStack() as held:
            if not compiled._compiling_counter:
                held.enter_context(one_process(Path(f"{file._index_path}.lock")))
                _remove_outdated(file)
            return compile_(signature)

    return compile_in_turn


@contextmanager
def _no_collection() -> Iterator[None]:
    """Let Python look for no garbage: a compiler makes millions of objects that stay.

    The looking takes a tenth of the time of compiling.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextmanager
def one_process(lock: Path) -> Iterator[None]:
    """Wait until no other process is in a block with this lock file.

    The system frees the lock of a process that is ended.
    """
    with ExitStack() as held:
        with suppress(ImportError, OSError):  # a system or disk without locks
            from fcntl import LOCK_EX, flock

            flock(held.enter_context(lock.open("w")), LOCK_EX)
        yield


def _remove_outdated(file: Any) -> None:
    """Remove the machine code of another version of a kernel.

    Numba notes the name of new code before it writes the code: a process that is ended
    in between would leave the old code under that name.
    """
    if file._load_index():
        return
    for number in itertools.count(1):
        path = Path(file._data_path(file._data_name(number)))
        if not path.exists():
            return
        with suppress(OSError):
            path.unlink()


def _codes(code: CodeType) -> list[CodeType]:
    """Return a function's code and that of the functions within it."""
    inner = [item for item in code.co_consts if isinstance(item, CodeType)]
    return [code, *(nested for item in inner for nested in _codes(item))]


def _plain(values: tuple[Any, ...]) -> list[Any]:
    """Return those of some values that are numbers, texts or tuples of them."""
    kinds = (bool, int, float, complex, str, bytes, tuple)
    return [value for value in values if isinstance(value, kinds)]


def njit(**options: Any) -> Callable[[Callable[..., Any]], Kernel]:
    """Make a function a kernel (options of `numba.njit`)."""
    return lambda function: Kernel(function, options)


def once(task: Callable[[], Result], *, patience: int | None = None) -> Result:
    """Return `task()`, quickest if this process does it once.

    Kernels called by `task` run as plain Python. If that takes long, `task` starts
    again with compiled ones; so it may do nothing that must not be done twice.

    Parameters
    ----------
    task : callable
        What to do.
    patience : int, optional
        Calls of kernels that are not too long; `PATIENCE` by default.
    """
    with suppress(_Unfit), _written(PATIENCE if patience is None else patience):
        return task()
    return task()


@contextmanager
def _written(calls: int) -> Iterator[None]:
    """Let kernels run as written in this context, so often."""
    import numpy as np

    global _as_written
    with _LOCK:
        _as_written += 1
        while _direct:
            kernel = _direct.pop()
            kernel.__call__ = kernel._called
    token = _calls_left.set([calls])
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            # Machine code says nothing of empty slices either.
            warnings.simplefilter("ignore", RuntimeWarning)
            yield
    finally:
        _calls_left.reset(token)
        with _LOCK:
            _as_written -= 1


def plain_first(
    kernel: Kernel, fits: Callable[..., bool] = lambda *_args, **_options: True
) -> Callable[[Function], Function]:
    """Make a function run as plain Python until compiling is worth while.

    Where no machine code of its `kernel` is at hand the first `FIRST_CALLS` calls of a
    process go through `once`: they take milliseconds, and compiling ten seconds. After
    them, or once the kernel is compiled for another reason, it runs compiled. The count
    of calls decides, not their time: a program gives the same digits each time.

    Parameters
    ----------
    kernel : Kernel
        The one that the function needs most.
    fits : callable, optional
        Tells of arguments whether plain Python is quick enough for them.
    """

    def decorate(function: Function) -> Function:
        left = [FIRST_CALLS]

        @functools.wraps(function)
        def call(*args: Any, **options: Any) -> Any:
            if PLAIN_FIRST and left[0] > 0:
                if _calls_left.get() is None and not kernel.is_at_hand:
                    if fits(*args, **options):
                        left[0] -= 1
                        return once(lambda: function(*args, **options), patience=MOST)
                elif kernel.is_at_hand:
                    left[0] = 0
            return function(*args, **options)

        return cast("Function", call)

    return decorate
