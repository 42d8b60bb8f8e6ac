"""What the lanes of rods in space hold: rows of `LANES` numbers in one array.

Row k of a thing is its elements from k `LANES` on. With constant distances in one array
the compiler knows what overlaps, and runs the loops over lanes on vectors.

The frame of a lane is fixed to its field: a cuboid's centre and axes, so that its field
need not be turned; the specimen's in a uniform field. The state, 21 rows, holds

    d1, d2, d3   the directors:            d_i' = -Omega x d_i
    m            the moment:               m' = d3 x n + p x B
    r            the position:             r' = -d3
    n            the force:                n' = G p + w
    B            the flux density at r:    B' = -G d3

by sigma = L - s, as `spatial.march`, but for all vectors in fixed components, with G
the gradient of the field, p the transverse magnetisation, and Omega = K m + the rest
curvature, K = sum C_i d_i d_i. A column, 12 rows, holds (t, dm, dr, dn) with the turn t
of the directors: t' = -K (dm - t x m).
"""

from __future__ import annotations

from ..spatial.march import WIDTH

LANES = 8
STATE, COLUMN = 21, 12
STAGES, LOOKS = 7, 4
"""Of a step of the state, and of its columns."""
SEEN = 31
"""Rows that a stage leaves for the columns: h d3, n, m, h K (xx, xy, xz, yy, yz, zz),
h p, B, G (xx, xy, xz, yy, yz), and h times its change along p."""

SECTION = 0
"""The section's numbers (`spatial.march`), its length over the number of steps."""
HALF = SECTION + WIDTH * LANES
"""Half sides of the cuboid, and B_r / 4 pi."""
G = HALF + 4 * LANES
BENT = G + 5 * LANES
Y = BENT + 5 * LANES
LOOK = Y + STATE * LANES
SLOPE = LOOK + STATE * LANES
FOUND = SLOPE + STAGES * STATE * LANES
"""The slope of a stage, before it is put away: the loops that do the work find and
leave all at constant distances."""
SIGHT = FOUND + STATE * LANES
KEPT = SIGHT + SEEN * LANES
Z = KEPT + SEEN * LANES
Z_LOOK = Z + 6 * COLUMN * LANES
Z_FOUND = Z_LOOK + COLUMN * LANES
Z_SLOPE = Z_FOUND + COLUMN * LANES
MATRIX = Z_SLOPE + 6 * LOOKS * COLUMN * LANES
"""Newton's matrix, row by row, and then its factors."""
TEST = MATRIX + 36 * LANES
LEVER = TEST + 36 * LANES
MISS = LEVER + 3 * LANES
TIP = MISS + 6 * LANES
"""Directors and position of the tip, as of the clamp."""
CLAMP = TIP + 12 * LANES
LAST = CLAMP + 12 * LANES
"""That of the tip under the load before."""
SURE = LAST + 12 * LANES
"""The least pivot of what must be positive for a rod to be stable for sure."""
TRACE = SURE + LANES
SIZE = TRACE + LANES
BEFORE = SIZE + LANES
RATE = BEFORE + LANES
"""The largest correction allowed, and what the last one was of the one before."""
PACK = RATE + LANES
"""Then the numbers of all sections."""
POSITIVE = 16383
"""Mask above all offsets that a loop computes: none is negative."""
OPTIONS = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
}
