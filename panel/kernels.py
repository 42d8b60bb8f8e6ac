"""Kernels that are not compiled yet: another process does it, the page says how far."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ..core.errors import MagbendError

EVERY_S = 1.0


class KernelWatch:
    """The thread that has the kernels compiled, once after installation.

    Machine code is made in a process of its own: within this one it would take the
    time of pages and of the stage.

    Parameters
    ----------
    changed : callable
        Told when there is more to say.

    Attributes
    ----------
    news : str
        How far it is; empty once there is nothing to wait for.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._known, self._ending = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, name="kernels", daemon=True)
        self.news = ""

    def begin(self) -> None:
        """Look what is compiled, and have the rest compiled."""
        self._thread.start()

    def close(self) -> None:
        """End it; what is compiled by now is kept."""
        self._ending.set()
        self._thread.join()

    def require(self) -> None:
        """Refuse while kernels are being compiled.

        Raises
        ------
        MagbendError
            If they are.
        """
        self._known.wait()
        if self.news:
            raise MagbendError(self.news)

    def _work(self) -> None:
        from ..analysis import is_warm

        try:
            if not is_warm():
                self._compile()
        finally:
            self.news = ""
            self._known.set()
            self._changed()

    def _compile(self) -> None:
        from ..analysis import stored, warm_up_beside

        helper = warm_up_beside()
        try:
            while helper.poll() is None and not self._ending.is_set():
                done, number = stored()
                self.news = (
                    "The numerical kernels are being compiled, once after "
                    f"installation: {done} of {number} parts are done. Pictures are "
                    "measured and shapes predicted when all are; the rest works."
                )
                self._known.set()
                self._changed()
                self._ending.wait(EVERY_S)
        finally:
            helper.terminate()
            helper.wait()
