"""Coefficients of normal forms at Hopf, period-doubling, pitchfork and Neimark-Sacker points.

On the eigenvector q of the multiplier that is on the unit circle (or of the eigenvalue on the imaginary axis)
the dynamics is, to third order, decided by one number, from second and third derivatives B, C of the map or
field whose derivative is A (Kuznetsov 2004, sections 3.5, 5.4 and 10.2; p is the left eigenvector, p.q = 1):

    flip            x -> -x + c x^3     c = p.[C(q,q,q) + 3 B(q, (1-A)^-1 B(q,q))]/6
    Neimark-Sacker  a = Re e^(-i theta) p.[C(q,q,q*) + 2 B(q, (1-A)^-1 B(q,q*))
                                           + B(q*, (e^(2 i theta)-A)^-1 B(q,q))]/2
    Hopf            l1 = Re p.[C(q,q,q*) - 2 B(q, A^-1 B(q,q*)) + B(q*, (2 i w-A)^-1 B(q,q))]/(2 w)

What branches off is stable in these directions (supercritical) where c > 0, a < 0, l1 < 0. B(q, .) and
C(q, q*, .) are matrices, the only ones that are needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model import Array, FilippovSystem
from ..model.expansions import field_expansion

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Expansion:
    """Derivatives of a map or field at a fixed point, as far as one eigenvector needs them.

    Attributes
    ----------
    a : ndarray (n, n)
    q, p : ndarray (n,)
        Right and left eigenvector, |q| = 1 and p.q = 1.
    second : ndarray (n, n)
        B(q, .).
    third : ndarray (n, n)
        C(q, q*, .).
    """

    a: Array
    q: Complex
    p: Complex
    second: Complex
    third: Complex


def eigenvectors(a: Array, value: complex) -> tuple[Complex, Complex]:
    """Right eigenvector q with |q| = 1 and left one p with p.q = 1, of the eigenvalue next to a value.

    Examples
    --------
    >>> q, p = eigenvectors(np.array([[-1.0, 0.0], [0.0, 0.5]]), -1.0)
    >>> np.abs(q).tolist(), complex(p @ q)
    ([1.0, 0.0], (1+0j))
    """

    def of(matrix: Array) -> Complex:
        values, vectors = np.linalg.eig(matrix)
        return np.asarray(vectors[:, int(np.argmin(np.abs(values - value)))], complex)

    q, p = of(a), of(a.T)
    q = q / np.linalg.norm(q)
    return q, p / (p @ q)


def flip_coefficient(at: Expansion) -> float:
    """The number c of a map whose derivative has the eigenvalue -1."""
    h = np.linalg.solve(np.eye(len(at.a)) - at.a, at.second @ at.q)
    return float((at.p @ (at.third @ at.q + 3.0 * at.second @ h)).real / 6.0)


def torus_coefficient(at: Expansion, turn: complex) -> float:
    """The number a of a map whose derivative has the eigenvalue ``turn`` on the unit circle."""
    one = np.eye(len(at.a))
    still = np.linalg.solve(one - at.a, at.second @ at.q.conj())
    double = np.linalg.solve(turn**2 * one - at.a, at.second @ at.q)
    inner = at.third @ at.q + 2.0 * at.second @ still + at.second.conj() @ double
    return float((at.p @ inner / turn).real / 2.0)


def hopf_coefficient(
    system: FilippovSystem, mode: str, x: Array, p: Array, frequency: float
) -> float:
    """The first Lyapunov coefficient l1 of an equilibrium of one mode, on its surface if that slides.

    Parameters
    ----------
    system : FilippovSystem
    mode : str
    x : ndarray (n,)
    p : ndarray
    frequency : float
        Of the imaginary pair.
    """
    forms = field_expansion(system, mode)
    a = forms.copied(np.append(x, np.zeros(x.size)), p)[0]
    q, left = eigenvectors(a, 1j * frequency)
    _, *real, gradient, bend = forms.copied(np.append(x, q.real), p)
    _, *imaginary, _, _ = forms.copied(np.append(x, q.imag), p)
    third = (real[1] + imaginary[1]).astype(complex)
    at = Expansion(a, q, left, real[0] + 1j * imaginary[0], third)
    matrix, right = a.astype(complex), -(at.second @ q.conj())
    if "s" in mode:  # a sliding field keeps h: what is across the surface follows its bend
        matrix = np.vstack([matrix, gradient.reshape(1, -1)])
        right = np.append(right, -(q @ bend @ q.conj()))
    still = np.linalg.lstsq(matrix, right, rcond=None)[0]
    double = np.linalg.solve(2j * frequency * np.eye(len(a)) - a, at.second @ q)
    inner = at.third @ q + 2.0 * at.second @ still + at.second.conj() @ double
    return float((left @ inner).real / (2.0 * frequency))
