"""What a stop has shown: by which means the stage stands, and what its place is worth.

A stop is proved or it is none: state, speed and place are read back. It has begun when
the speed falls, within `BEGIN_S`; it has ended when two answers in a row say that the
stage stands at one place, no farther than the stopping distance and a fifth of it. What
shows neither is taken to the next means.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

BEGIN_S = 0.3
"""How long after its byte a stop may show nothing, in s."""

MARGIN = 1.2
"""How far a stop may run, in stopping distances."""

Means = Literal["nothing", "jog cancel", "feed hold", "end of the piece", "reset"]
"""What brought it to a stand; ``nothing``: it stood already."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StopProof:
    """How a stop went.

    Attributes
    ----------
    means : str
        One of `Means`.
    tried : tuple of str
        The means before it, and what each was found wanting in.
    begun_s, stood_s : float or None
        From the first byte until the stage was seen slowing, and standing, in s.
    machine_mm : float or None
        Where it stands.
    run_out_mm : float or None
        From the first place reported after the byte to where it stands.
    is_place_kept : bool
        Whether the count of the board is still worth what it was.
    """

    means: Means
    tried: tuple[str, ...] = ()
    begun_s: float | None = None
    stood_s: float | None = None
    machine_mm: float | None = None
    run_out_mm: float | None = None
    is_place_kept: bool = True

    def sentence(self) -> str:
        """Return in words what it took and what the place is worth."""
        if self.means == "nothing":
            how = "it stood already"
        else:
            when = "" if self.stood_s is None else f", {self.stood_s:.1f} s"
            far = "" if self.run_out_mm is None else f", {self.run_out_mm:.2f} mm on"
            how = f"it stands by {self.means}{when}{far}"
        failed = f" ({'; '.join(self.tried)})" if self.tried else ""
        worth = (
            "the position was kept"
            if self.is_place_kept
            else "the position is unverified: home it (magbend rig home)"
        )
        return f"{how}{failed}; {worth}"
