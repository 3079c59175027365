"""A chain of blocks on a belt for the independent integrator: up to four friction surfaces at once."""

from __future__ import annotations

import numpy as np

COUPLING, SPRING, BELT, FALL = 1.0, 0.1, 0.3, 0.1


def friction(count: int) -> np.ndarray:
    """Friction of each block."""
    return 1.0 + 0.2 * np.arange(count)


class Blocks:
    """Chains of one length from many starts; the interface is that of ``family.Many``.

    Parameters
    ----------
    x0 : ndarray (S, 2 k)
        Displacements and velocities.
    """

    def __init__(self, x0: np.ndarray):
        self.x0 = np.asarray(x0, np.longdouble)
        self.count, size = self.x0.shape
        k = self._k = size // 2
        self.n, self.m = np.full(self.count, size), np.full(self.count, k)
        ends = np.eye(k, k=1) + np.eye(k, k=-1)
        springs = SPRING * np.eye(k) + COUPLING * (np.diag(ends.sum(axis=1)) - ends)
        self._springs = springs.astype(np.longdouble)

    def part(self, chosen: np.ndarray) -> Blocks:
        """Return some of the chains."""
        return Blocks(self.x0[chosen])

    def field(self, x: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Field without multipliers, and what multiplies them."""
        k = self._k
        q, v = x[:, :k], x[:, k:]
        pull = -(self._springs[None] * q[:, None, :]).sum(axis=2) + FALL * (v - BELT)
        g = np.zeros((len(x), k, 2 * k), np.longdouble)
        g[:, np.arange(k), k + np.arange(k)] = -friction(k)
        return np.concatenate([v, pull], axis=1), g

    def surfaces(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slip of each block, and its gradient."""
        k = self._k
        gradient = np.zeros((len(x), k, 2 * k), np.longdouble)
        gradient[:, np.arange(k), k + np.arange(k)] = 1.0
        return x[:, k:] - np.longdouble(BELT), gradient
