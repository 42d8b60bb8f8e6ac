"""Linear light to the 8-bit values of a picture file (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def encode_srgb(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return linear light from 0 to 1 as 8-bit sRGB; what lies outside is cut."""
    index = linear * np.float32(len(_TABLE) - 1)
    index += np.float32(0.5)
    np.clip(index, 0, len(_TABLE) - 1, out=index)
    return np.asarray(np.take(_TABLE, index.astype(np.uint16)))


def _table() -> NDArray[np.uint8]:
    x = np.linspace(0.0, 1.0, 65536)
    curve = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)
    return np.asarray(np.round(255.0 * curve), dtype=np.uint8)


_TABLE = _table()
