"""What may come out of a planar solve."""

from __future__ import annotations

OK_STABLE, OK_UNSTABLE, GONE, FAILED, TOO_STRONG, TOUCHES, FOLLOW = range(7)
"""Outcomes: stable, unstable, no equilibrium, no convergence, load beyond `MAX_REACH`,
undeformed rod touches the magnet; and, inside `planar.solver`, load to be followed."""
ROUNDING = 2e-14
"""What rounding may leave of a residual, in lengths of the rod."""
