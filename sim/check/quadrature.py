"""Gauss points on the elements of a rod: integrals, their adjoint, interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quadrature:
    """Gauss points of all elements, root first (q = elements x points).

    Parameters
    ----------
    edges : ndarray, shape (elements + 1,)
        Arc lengths of the ends of elements.
    xi, share : ndarray, shape (points,)
        Places and weights on [-1, 1].
    inner : ndarray, shape (points, points)
        Integrals from -1 to each place.
    half : ndarray, shape (elements,)
        Half their lengths.
    s, weight : ndarray, shape (q,)
        Arc lengths and weights of all points.
    """

    edges: Array
    xi: Array
    share: Array
    inner: Array
    half: Array
    s: Array
    weight: Array

    @classmethod
    def of(cls, edges: Array, points: int) -> Quadrature:
        """Return so many points on each element."""
        xi, share = np.polynomial.legendre.leggauss(points)
        half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
        return cls(
            edges=edges, xi=xi, share=share, inner=integrals(xi), half=half,
            s=(middle[:, None] + half[:, None] * xi).ravel(),
            weight=(half[:, None] * share).ravel(),
        )  # fmt: skip

    def integral(self, f: Array) -> Array:
        """Return the integral of f (q, ...) from the root to each point."""
        parts = self._by_elements(f)
        ends = self.half[:, None] * np.einsum("j,ejm->em", self.share, parts)
        before = np.cumsum(ends, axis=0) - ends
        inside = self.half[:, None, None] * (self.inner @ parts)
        whole: Array = (inside + before[:, None]).reshape(f.shape)
        return whole

    def beyond(self, f: Array) -> Array:
        """Return the adjoint of `integral`: what f (q, ...) of later points weighs."""
        parts = self._by_elements(f)
        sums = parts.sum(axis=1)
        after = np.cumsum(sums[::-1], axis=0)[::-1] - sums
        inside = self.inner.T @ parts + self.share[:, None] * after[:, None]
        whole: Array = (self.half[:, None, None] * inside).reshape(f.shape)
        return whole

    def at(self, f: Array, s: Array) -> Array:
        """Return the elements' polynomials through f (q, m) at arc lengths (n,)."""
        last = len(self.half) - 1
        which = np.clip(np.searchsorted(self.edges, s) - 1, 0, last)
        xi = (s - self.edges[which]) / self.half[which] - 1.0
        values = np.polynomial.legendre.legvander(xi, len(self.xi) - 1)
        found: Array = np.einsum("nj,njm->nm", values, self.coefficients(f)[which])
        return found

    def coefficients(self, f: Array) -> Array:
        """Return Legendre coefficients (elements, points, m) of f (q, m)."""
        inverse = np.linalg.inv(
            np.polynomial.legendre.legvander(self.xi, len(self.xi) - 1)
        )
        return inverse @ self._by_elements(f)

    def _by_elements(self, f: Array) -> Array:
        return f.reshape(len(self.half), len(self.xi), -1)


def integrals(xi: Array) -> Array:
    """Integrate from -1 to each Gauss point: exact for the interpolating polynomial."""
    n = len(xi)
    inverse = np.linalg.inv(np.polynomial.legendre.legvander(xi, n - 1))
    upper: Any = np.stack(
        [
            np.polynomial.legendre.legval(
                xi, np.polynomial.legendre.legint(row, lbnd=-1.0)
            )
            for row in np.eye(n)
        ],
        axis=1,
    )
    whole: Array = upper @ inverse
    return whole
