"""Whether a planar equilibrium of any section holds in space, by the index there.

`planar.swing` answers it for sections that are as stiff in all directions; a flat strip
twists as it leaves its plane, and leaves it where a square rod would stay.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.specimen import Specimen
from ..fields import Support
from .index import morse_index
from .solver import _held, _steps

Array = NDArray[np.float64]


def index_in_space(
    specimen: Specimen, support: Support, field: Array, tip: Array
) -> int:
    """Count the directions in space in which a planar equilibrium is unstable.

    Parameters
    ----------
    specimen, support
        The rod.
    field : ndarray
        As the kernels take it.
    tip : ndarray, shape (4,)
        The unknowns (gamma, x_L, y_L, phi) of the planar march.

    Returns
    -------
    int
        The Morse index; -1 where the load is beyond the reach of the march in space.
    """
    gamma, x, y, phi = tip.tolist()
    c, s = math.cos(gamma + phi), math.sin(gamma + phi)
    turn, place = np.array([[-s, 0.0, c], [c, 0.0, s], [0.0, 1.0, 0.0]]), [x, y, 0.0]
    table = _held(specimen, support)[0]
    try:
        n = _steps(table, field, np.array(place))
    except InputError:
        return -1
    return int(morse_index(table, field, 1.0, n, turn, np.array(place)))
