"""Contact models of the literature: linear, Hertzian, and with depth-dependent damping.

All are dimensionless: length the ball's radius, mass the ball's, and the unit of time is given by the stiffness. The
tangential surface is linear, -(2 d1 eta X' + eta^2 X), as in Biber, Champneys & Szalai (2022).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any

import casadi as ca

import nonsmooth as ns

from ..parameters import LIMITS, Names, number
from .model import ContactModel

Expression = Any


class _LinearTangential(ContactModel):
    """A linear spring and damper along the ground; base of the models below."""

    parameters = dict(d1=0.0, eta=0.0)
    limits = dict(d1=">= 0", eta=">= 0")

    def tangential_force(self, s: Names, p: Names) -> Expression:
        return -(2 * p.d1 * p.eta * s.xdot + p.eta**2 * s.x)

    @abstractmethod
    def _normal_energy(self, s: Names, p: Names) -> Expression:
        """Elastic energy of the normal spring."""

    def stored_energy(self, s: Names, p: Names) -> Expression:
        """Elastic energy of both springs."""
        return 0.5 * p.eta**2 * ca.sumsqr(s.x) + self._normal_energy(s, p)


class KelvinVoigt(_LinearTangential):
    """Spring and damper in parallel in both directions: the paper's linear model, eq. (kv_rescaled).

    $X'' + 2 d1 eta X' + eta^2 X = Lambda_T$,  $Y'' + 2 d2 Y' + Y = -G$,  $Omega' = Lambda_T / inertia$.

    Source: Biber, Champneys & Szalai 2022, Sec. 3.

    Parameters
    ----------
    mu : float
        Friction coefficient, not negative.
    d1, d2 : float
        Damping ratios along and normal to the ground, not negative.
    eta : float
        Ratio of the tangential to the normal natural frequency, not negative.
    G : float, optional
        Scaled gravity, the paper's $eps2^2 g$, not negative.
    load : {"contact", "net"}
        "net" is the paper's $Lambda_N = -2 d2 Y' - Y - G$.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4, load="net")
    >>> turf
    KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=0.0001, load='net')
    >>> shot = bounce.simulate(turf, xdot=0.3, ydot=-1.0, omega=0.1)
    >>> shot.itinerary, f"{shot.slip:.8f}"
    ('+ s -', '-0.00634085')
    """

    parameters = dict(mu=None, d1=None, d2=None, eta=None, G=0.0)
    limits = dict(d2=">= 0")

    def normal_force(self, s: Names, p: Names) -> Expression:
        return -2 * p.d2 * s.ydot - s.y

    def _normal_energy(self, s: Names, p: Names) -> Expression:
        return 0.5 * s.y**2


class NormalKelvinVoigt(ContactModel):
    """Normal spring and damper, rigid tangential contact: rolling, once begun, lasts.

    Its lift-off without gravity is that of :class:`bounce.laws.RigidBounce` with the exact ``restitution``.

    Parameters
    ----------
    mu, d2 : float
        Friction coefficient, and damping ratio of the normal contact.
    G : float, optional
        Gravity relative to the normal spring's force.

    Examples
    --------
    >>> import bounce
    >>> soft = bounce.NormalKelvinVoigt(mu=0.3, d2=0.1)
    >>> shot = bounce.simulate(soft, xdot=1.0, ydot=-1.0, omega=0.5, tol=1e-12)
    >>> abs(shot.restitution - soft.restitution) < 1e-12
    True
    """

    parameters = dict(mu=None, d2=None, G=0.0)
    limits = dict(d2=">= 0")

    def normal_force(self, s: Names, p: Names) -> Expression:
        return -2 * p.d2 * s.ydot - s.y

    def tangential_force(self, s: Names, p: Names) -> Expression:
        return 0

    def stored_energy(self, s: Names, p: Names) -> Expression:
        """Elastic energy of the normal spring."""
        return 0.5 * s.y**2

    @property
    def restitution(self) -> float:
        """Exact restitution without gravity."""
        return kelvin_voigt_restitution(self.values["d2"])


def kelvin_voigt_restitution(d2: float) -> float:
    """Restitution of $Y'' + 2 d2 Y' + Y = 0$ from touch-down to zero force, for any damping ratio.

    $-ln r = 2 c cot c$ with $c = arccos d2$, and its continuation $2 a coth a$, $a = arcosh d2$, beyond
    critical damping. With $b = arcsin d2$ this is $r = exp(-tan b (pi - 2 b))$; for $d = 2 d2$ small it
    is $exp(-pi d/2 + d^2/2 - pi d^3/16 + ...)$.

    Parameters
    ----------
    d2 : float
        Damping ratio, not negative.

    Returns
    -------
    float
        Normal speed at lift-off over that at touch-down, from 1 without damping to 0.

    Examples
    --------
    >>> round(kelvin_voigt_restitution(0.1), 12), round(kelvin_voigt_restitution(1.0), 12)
    (0.744..., 0.135335283237)
    """
    ratio = number(d2, "d2")
    if not LIMITS[">= 0"](ratio):
        raise ns.ParameterError(f"d2: expected a number >= 0, received {d2!r}.")
    if ratio == 1.0:
        return math.exp(-2.0)
    c = math.acos(ratio) if ratio < 1 else math.acosh(ratio)
    return math.exp(-2 * c / (math.tan(c) if ratio < 1 else math.tanh(c)))


class DepthDampedKelvinVoigt(KelvinVoigt):
    """Kelvin-Voigt whose tangential damper grows with depth: $-(2 d1 eta (-Y) X' + eta^2 X)$.

    The damper acts on the part of the ball that is in the ground, so it starts from zero at
    touch-down and satisfies the paper's $upsilon_Y < 0$, eq. (functions_constraints).

    Parameters
    ----------
    mu, d1, d2, eta : float
        Friction coefficient; damping ratios, tangential and normal; tangential frequency relative to
        the normal one.
    G : float, optional
        Gravity relative to the normal spring's force.
    """

    def tangential_force(self, s: Names, p: Names) -> Expression:
        return -(2 * p.d1 * p.eta * (-s.y) * s.xdot + p.eta**2 * s.x)


class _PowerLaw(_LinearTangential):
    """Normal force (-Y)^q times a factor that is regular where the contact ends."""

    limits = dict(stiffness="> 0", damping=">= 0")

    @abstractmethod
    def _power(self, s: Names) -> Expression:
        """(-Y)^q."""

    @abstractmethod
    def _factor(self, s: Names, p: Names) -> Expression:
        """The normal force over that power."""

    def _end(self, s: Names, p: Names) -> Expression:
        """What falls through zero at the end of a contact without gravity in the load."""
        return self._factor(s, p)

    def normal_force(self, s: Names, p: Names) -> Expression:
        return self._power(s) * self._factor(s, p)

    def lift_off(self, s: Names, p: Names) -> Expression:
        """The load over a positive function, so that it is not small where the contact begins."""
        if self.convention == "contact":
            return self._end(s, p)
        return self.load(s, p) / (self._power(s) + p.G * ca.cos(p.slope))

    def _normal_energy(self, s: Names, p: Names) -> Expression:
        return 2 / 5 * p.stiffness * (-s.y) ** 2.5


class Hertz(_PowerLaw):
    """Elastic Hertzian contact: the normal force is $stiffness (-Y)^(3/2)$.

    Source: Hertz 1881; Johnson 1985, Contact Mechanics, eq. (4.22).

    Parameters
    ----------
    mu, stiffness : float
        Friction coefficient, and stiffness of the normal contact.
    d1, eta, G : float, optional
        Tangential damping ratio and frequency, and gravity; default 0.

    Examples
    --------
    >>> import bounce
    >>> shot = bounce.simulate(bounce.Hertz(mu=0.3, stiffness=1.0), 0.1, -1.0, 2.0)
    >>> f"{shot.lift_off.ydot:.9f}", abs(shot.lift_off.y) < 1e-9  # elastic: it keeps its speed
    ('1.000000000', True)
    """

    parameters = dict(mu=None, stiffness=None, d1=0.0, eta=0.0, G=0.0)

    def _power(self, s: Names) -> Expression:
        return (-s.y) ** 1.5

    def _factor(self, s: Names, p: Names) -> Expression:
        return p.stiffness

    def _end(self, s: Names, p: Names) -> Expression:
        return -s.y


class HuntCrossley(_PowerLaw):
    """Hertzian contact whose damping vanishes with the depth: $(-Y)^(3/2) (stiffness - damping Y')$.

    Source: Hunt & Crossley 1975.

    Parameters
    ----------
    mu, stiffness, damping : float
        Friction coefficient; stiffness and damping of the normal contact.
    d1, eta, G : float, optional
        Tangential damping ratio and frequency, and gravity; default 0.
    """

    parameters = dict(mu=None, stiffness=None, damping=None, d1=0.0, eta=0.0, G=0.0)

    def _power(self, s: Names) -> Expression:
        return (-s.y) ** 1.5

    def _factor(self, s: Names, p: Names) -> Expression:
        return p.stiffness - p.damping * s.ydot

    def _end(self, s: Names, p: Names) -> Expression:
        return -s.y * self._factor(s, p)


class Tsuji(_PowerLaw):
    """Hertzian contact with restitution nearly free of speed: $(-Y)^(1/4) (k (-Y)^(5/4) - c Y')$.

    Source: Tsuji, Tanaka & Ishida 1992, eq. for $eta_n$.

    Parameters
    ----------
    mu, stiffness, damping : float
        Friction coefficient; k and c. Tsuji's $alpha$ is $c/sqrt(k)$ for unit mass.
    d1, eta, G : float, optional
        Tangential damping ratio and frequency, and gravity; default 0.
    """

    parameters = dict(mu=None, stiffness=None, damping=None, d1=0.0, eta=0.0, G=0.0)
    limits = dict(damping="> 0")

    def _power(self, s: Names) -> Expression:
        return (-s.y) ** 0.25

    def _factor(self, s: Names, p: Names) -> Expression:
        return p.stiffness * (-s.y) ** 1.25 - p.damping * s.ydot


class KuwabaraKono(_PowerLaw):
    """Hertzian contact of viscoelastic bodies: $(-Y)^(1/2) (stiffness (-Y) - damping Y')$.

    Source: Kuwabara & Kono 1987; Brilliantov, Spahn, Hertzsch & Poeschel 1996. Sometimes also
    listed under Tsuji's name.

    Parameters
    ----------
    mu, stiffness, damping : float
        Friction coefficient; stiffness and damping of the normal contact.
    d1, eta, G : float, optional
        Tangential damping ratio and frequency, and gravity; default 0.
    """

    parameters = dict(mu=None, stiffness=None, damping=None, d1=0.0, eta=0.0, G=0.0)
    limits = dict(damping="> 0")

    def _power(self, s: Names) -> Expression:
        return (-s.y) ** 0.5

    def _factor(self, s: Names, p: Names) -> Expression:
        return p.stiffness * (-s.y) - p.damping * s.ydot


class Maxwell(_LinearTangential):
    """Normal spring in parallel with a spring and damper in series (standard linear solid).

    The force B of the branch is the internal state ``branch``: $B' = -k Y' - B/relaxation$, and the
    normal force is $-Y + B$.

    Parameters
    ----------
    mu : float
        Friction coefficient.
    branch_stiffness : float
        k, relative to the spring in parallel.
    relaxation : float
        Time in which the branch's force decays.
    d1, eta, G : float, optional
        Tangential damping ratio and frequency, and gravity; default 0.
    """

    parameters = dict(mu=None, branch_stiffness=None, relaxation=None, d1=0.0, eta=0.0, G=0.0)
    limits = dict(branch_stiffness=">= 0", relaxation="> 0")
    extra_states = dict(branch=0.0)

    def normal_force(self, s: Names, p: Names) -> Expression:
        return -s.y + s.branch

    def extra_rates(self, s: Names, p: Names) -> dict[str, Expression]:
        """Rate of the branch's force."""
        return dict(branch=-p.branch_stiffness * s.ydot - s.branch / p.relaxation)

    def _normal_energy(self, s: Names, p: Names) -> Expression:
        return 0.5 * s.y**2 + 0.5 * s.branch**2 / p.branch_stiffness
