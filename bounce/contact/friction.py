"""Friction laws: the traction (tangential force per unit of load) as a function of the slip.

The slip speed is ``s.slip`` = |H|, H = X' + Omega. In forward slip (H > 0) the traction of a
set-valued law is ``-coefficient``, in reverse slip ``+coefficient``; while rolling it is what
keeps H = 0, at most the coefficient at zero slip. A law with a bristle state is single-valued.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import casadi as ca

from ..parameters import Names, Parametrised

Expression = Any


class FrictionLaw(Parametrised, ABC):
    """Base of friction laws. To write one:

    1. ``parameters``: its names and defaults, besides ``mu``, which every contact model has, and
       ``limits`` (a name and its limit, such as ``"> 0"``), of ``mu`` too where zero is none.
    2. ``coefficient(s, p)``: the traction's magnitude at slip speed ``s.slip``, which is not
       negative, smooth there.
    3. Optional ``extra_states`` (names and their values at the start) and ``extra_rates(s, p, sign)``.
    4. Optional ``traction(s, p, sign)`` for a law that is not ``-sign * coefficient``.
    """

    extra_states: ClassVar[Mapping[str, float]] = {}
    #: Those of ``extra_states`` that have a component along each direction of the ground in 3-D.
    vector_states: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def coefficient(self, s: Names, p: Names) -> Expression:
        """Return the traction's magnitude while slipping.

        Parameters
        ----------
        s, p : namespace
            Symbols of the states, with ``s.slip``, and of the parameters.
        """

    def traction(self, s: Names, p: Names, sign: Expression) -> Expression:
        """Return the tangential force per unit of load where the slip has the sign ``sign``.

        Parameters
        ----------
        s, p : namespace
            Symbols of the states, with ``s.slip``, and of the parameters.
        sign : SX symbol
            The sign of the slip; between -1 and 1 while the ball rolls.
        """
        return -sign * self.coefficient(s, p)

    def vector_traction(
        self, s: Names, p: Names, direction: Expression, coefficient: Expression
    ) -> Expression:
        """Return the tangential force per unit of load of a set-valued law in 3-D.

        Parameters
        ----------
        s, p : namespace
            Symbols of the states, with ``s.slip``, and of the parameters.
        direction : SX (2,)
            Direction of the slip; inside the unit circle while the ball rolls.
        coefficient : expression
            That of the contact model.
        """
        return -direction * coefficient

    def extra_rates(self, s: Names, p: Names, sign: Expression) -> dict[str, Expression]:
        """Return the rates of ``extra_states`` where the slip has the sign ``sign``.

        Parameters
        ----------
        s, p : namespace
            Symbols of the states, with ``s.slip``, and of the parameters.
        sign : SX symbol
            The sign of the slip.
        """
        return {}


class Coulomb(FrictionLaw):
    """Constant coefficient ``mu``: the law of the paper.

    Examples
    --------
    >>> Coulomb()
    Coulomb()
    """

    def coefficient(self, s: Names, p: Names) -> Expression:
        return p.mu


class Stribeck(FrictionLaw):
    """A coefficient that falls from ``mu`` at rest to ``mu_kinetic`` in fast slip.

    At slip speed H it is $mu_k + (mu - mu_k) exp(-(H/v)^2)$.

    Source: Stribeck 1902; this form Armstrong-Helouvry 1991.

    Parameters
    ----------
    mu_kinetic : float
        Coefficient of fast slip.
    stribeck_speed : float
        The speed v at which the difference has fallen by a factor e, in the model's units.

    Examples
    --------
    >>> import bounce
    >>> law = bounce.contact.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5)
    >>> bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, friction=law)
    KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, mu_kinetic=0.2, stribeck_speed=0.5, friction=Stribeck)
    """

    parameters = dict(mu_kinetic=None, stribeck_speed=None)
    limits = dict(mu_kinetic="> 0", stribeck_speed="> 0")

    def coefficient(self, s: Names, p: Names) -> Expression:
        return p.mu_kinetic + (p.mu - p.mu_kinetic) * ca.exp(-(s.slip**2) / p.stribeck_speed**2)


class ExponentialDecay(FrictionLaw):
    """A coefficient that falls exponentially with the slip, with a corner at zero slip.

    At slip speed H it is $mu_k + (mu - mu_k) exp(-H/v)$.

    Source: Oden & Martins 1985; the law of finite-element codes.

    Parameters
    ----------
    mu_kinetic, decay_speed : float
        Coefficient $mu_k$ of fast slip, and the speed v over which the difference falls by a factor e.
    """

    parameters = dict(mu_kinetic=None, decay_speed=None)
    limits = dict(mu_kinetic="> 0", decay_speed="> 0")

    def coefficient(self, s: Names, p: Names) -> Expression:
        return p.mu_kinetic + (p.mu - p.mu_kinetic) * ca.exp(-s.slip / p.decay_speed)


class Viscous(FrictionLaw):
    """Coulomb's law and a part proportional to the slip: $mu + viscosity H$.

    Parameters
    ----------
    viscosity : float
        Per unit of speed.
    """

    parameters = dict(viscosity=None)
    limits = dict(viscosity=">= 0")

    def coefficient(self, s: Names, p: Names) -> Expression:
        return p.mu + p.viscosity * s.slip

    def vector_traction(
        self, s: Names, p: Names, direction: Expression, coefficient: Expression
    ) -> Expression:
        """Return the force with its viscous part in the slip itself, which is smooth at zero."""
        return -(p.mu * direction + p.viscosity * (s.xdot + s.omega))


class LuGre(FrictionLaw):
    """A bristle of deflection z: $z' = H - k |H| z / g(H)$, g of Stribeck's form.

    The traction is $-(k z + c z' + viscosity H)$, c the bristle's damping. It is single-valued:
    the ball creeps instead of rolling exactly, and stick is H near zero.

    Source: Canudas de Wit, Olsson, Astrom & Lischinsky 1995, with the force per unit of load as in
    their later tyre models.

    Parameters
    ----------
    bristle_stiffness : float
        k, per unit of length; the bristle's force is at most ``mu`` times the load.
    bristle_damping, viscosity : float
        Per unit of speed.
    mu_kinetic, stribeck_speed : float
        Of g, as in :class:`Stribeck`.
    """

    parameters = dict(
        bristle_stiffness=None,
        bristle_damping=0.0,
        viscosity=0.0,
        mu_kinetic=None,
        stribeck_speed=None,
    )
    limits = dict(
        mu="> 0",  # the bristle's deflection is limited by what divides by it
        bristle_stiffness="> 0",
        bristle_damping=">= 0",
        viscosity=">= 0",
        mu_kinetic="> 0",
        stribeck_speed="> 0",
    )
    extra_states = dict(bristle=0.0)
    vector_states = ("bristle",)

    def coefficient(self, s: Names, p: Names) -> Expression:
        return p.mu_kinetic + (p.mu - p.mu_kinetic) * ca.exp(-(s.slip**2) / p.stribeck_speed**2)

    def extra_rates(self, s: Names, p: Names, sign: Expression) -> dict[str, Expression]:
        """Return the bristle's rate."""
        decay = p.bristle_stiffness * s.slip / self.coefficient(s, p)
        return dict(bristle=s.xdot + s.omega - decay * s.bristle)

    def traction(self, s: Names, p: Names, sign: Expression) -> Expression:
        """Return the bristle's force per unit of load; ``sign`` enters through the slip only."""
        rate = self.extra_rates(s, p, sign)["bristle"]
        elastic = p.bristle_stiffness * s.bristle + p.bristle_damping * rate
        return -(elastic + p.viscosity * (s.xdot + s.omega))


class Dahl(FrictionLaw):
    """A bristle without Stribeck effect: $z' = H - k |H| z / mu$, with the traction $-k z$.

    Source: Dahl 1968.

    Parameters
    ----------
    bristle_stiffness : float
        k, per unit of length.
    """

    parameters = dict(bristle_stiffness=None)
    limits = dict(mu="> 0", bristle_stiffness="> 0")
    extra_states = dict(bristle=0.0)
    vector_states = ("bristle",)

    def coefficient(self, s: Names, p: Names) -> Expression:
        return p.mu

    def extra_rates(self, s: Names, p: Names, sign: Expression) -> dict[str, Expression]:
        """Return the bristle's rate."""
        decay = p.bristle_stiffness * s.slip / p.mu
        return dict(bristle=s.xdot + s.omega - decay * s.bristle)

    def traction(self, s: Names, p: Names, sign: Expression) -> Expression:
        """Return the bristle's force per unit of load."""
        return -p.bristle_stiffness * s.bristle
