"""Drag and lift of a ball in air, with published coefficients and fitted ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import nonsmooth as ns

from ..parameters import LIMITS, number
from ..units import GOLF, Ball


@dataclass(frozen=True)
class Air:
    """Drag and lift of a ball in air.

    Parameters
    ----------
    drag, lift : callable (spin_ratio, reynolds) -> coefficient
        Coefficients of drag and lift from the spin ratio (surface speed over speed, not negative) and
        the Reynolds number; numbers in, numbers out.
    spin_decay : float, optional
        c of $omega' = -c v omega/R$, with the speed v and the ball's radius R.
    density : float, optional
        kg/m³; 1.204 is dry air at 20 degrees C and 101.325 kPa.
    viscosity : float, optional
        Kinematic, m²/s; 1.516e-5 at 20 degrees C.
    largest_spin_ratio : float, optional
        Beyond it the coefficients keep their value there: a slow ball leaves every measured range.
    largest_reynolds : float, optional
        A launch beyond it is computed with a warning: no such fast ball was measured.
    name, source : str, optional
        What the law is called, and where its coefficients come from.

    Examples
    --------
    >>> import bounce
    >>> smooth = Air(drag=lambda s, re: 0.45, lift=lambda s, re: 0.0)
    >>> launch = bounce.Landing(10.0, 10.0, 0.0)
    >>> bounce.golf.flight(launch, air=smooth).range < bounce.golf.flight(launch).range
    True
    """

    drag: Callable[[float, float], float]
    lift: Callable[[float, float], float]
    spin_decay: float = 0.0
    density: float = 1.204
    viscosity: float = 1.516e-5
    largest_spin_ratio: float = math.inf
    largest_reynolds: float = math.inf
    name: str = ""
    source: str = ""

    def cautions(self, speed: float, ball: Ball) -> tuple[str, ...]:
        """Return a caution for a ball faster than any that the coefficients were measured for.

        Parameters
        ----------
        speed : float
            m/s.
        ball : Ball
            Its radius counts.

        Returns
        -------
        tuple of str
            Empty if it is not.

        Examples
        --------
        >>> SMITS_SMITH.cautions(70.0, GOLF)
        ()
        """
        fastest = self.largest_reynolds * self.viscosity / (2 * ball.radius)
        if speed <= fastest:
            return ()
        return (
            f"air: a launch at {speed:.4g} m/s, faster than {fastest:.3g} m/s (Re = "
            f"{self.largest_reynolds:g}), the most for which the drag and lift {self._of()}hold. The flight "
            "is an extrapolation.",
        )

    def at(self, altitude: float = 0.0, temperature: float = 20.0) -> Air:
        """Return the same coefficients in dry air at an altitude and a temperature.

        Pressure is that of the U.S. Standard Atmosphere 1976, viscosity Sutherland's.

        Parameters
        ----------
        altitude : float, optional
            m above the sea, below 11,000.
        temperature : float, optional
            Degrees C.

        Returns
        -------
        Air
            With another density and viscosity.

        Raises
        ------
        nonsmooth.OptionError
            An altitude outside -1000 to 11,000 m, or a temperature outside -60 to 60 degrees C.

        Examples
        --------
        >>> high = SMITS_SMITH.at(altitude=1600.0, temperature=25.0)
        >>> f"{high.density:.3f} kg/m3"
        '0.976 kg/m3'
        """
        if not (-1000.0 <= altitude <= 11000.0 and -60.0 <= temperature <= 60.0):
            raise ns.OptionError(
                f"altitude={altitude!r}, temperature={temperature!r}: expected -1000 to 11000 m and -60 to "
                "60 degrees C."
            )
        kelvin = temperature + 273.15
        pressure = 101325.0 * (1.0 - 2.25577e-5 * altitude) ** 5.25588
        density = pressure / (287.053 * kelvin)
        dynamic = 1.458e-6 * kelvin**1.5 / (kelvin + 110.4)
        return replace(self, density=density, viscosity=dynamic / density)

    def _of(self) -> str:
        return f"of {self.name} " if self.name else ""

    def __post_init__(self) -> None:
        limits = dict(spin_decay=">= 0", density="> 0", viscosity="> 0")
        for what, limit in limits.items():
            value = number(getattr(self, what), f"Air: {what}")
            if not LIMITS[limit](value):
                raise ns.ParameterError(
                    f"Air: {what}: expected a number {limit}, received {value!r}."
                )
        for what in ("drag", "lift"):
            if not callable(getattr(self, what)):
                raise ns.ParameterError(
                    f"Air: {what}: expected a function (spin_ratio, reynolds), received "
                    f"{getattr(self, what)!r}. For a constant write lambda s, re: ..."
                )


def _smits_smith_drag(spin_ratio: float, reynolds: float) -> float:
    transition = min(max((reynolds - 90e3) / 200e3, 0.0), 1.0)
    return 0.24 + 0.18 * spin_ratio + 0.06 * math.sin(math.pi * transition)


#: Cd = 0.24 + 0.18 S + 0.06 sin(pi (Re - 90000)/200000), Cl = 0.54 S^0.4.
SMITS_SMITH = Air(
    drag=_smits_smith_drag,
    lift=lambda s, re: 0.54 * s**0.4,
    spin_decay=2.0e-5,
    largest_spin_ratio=1.4,
    largest_reynolds=2.5e5,
    name="smits-smith",
    source="Smits & Smith 1994, A new aerodynamic model of a golf ball in flight, Science and Golf II, "
    "340-347, measured for Re in 4e4..2.5e5 and S in 0.04..1.4; coefficients as quoted by public "
    "golf simulators, decay as in Penner 2001, Am. J. Phys. 69, 563, eq. 16 (others quote 0.9e-5). "
    "The sine is held at zero outside its band (a choice here).",
)

#: Cd = 0.171 + 0.62 S, Cl = 0.083 + 0.885 S, moment coefficient 0.0125 S.
QUINTAVALLA = Air(
    drag=lambda s, re: 0.171 + 0.62 * s,
    lift=lambda s, re: 0.083 + 0.885 * s,
    # The torque (density/2) v^2 area Cm 2 radius over inertia 2/5 m radius^2, for a golf ball.
    spin_decay=0.0125 * 1.204 * math.pi * GOLF.radius**3 / (GOLF.inertia * GOLF.mass),
    largest_spin_ratio=0.5,
    largest_reynolds=2.9e5,
    name="quintavalla",
    source="Quintavalla 2002, A generally applicable model for the aerodynamic behavior of golf balls, "
    "Science and Golf IV; coefficients as quoted by a public implementation. No range was quoted: "
    "S is held at 0.5, and Re above 2.9e5, 0.3 of the speed of sound, is cautioned (choices here).",
)

#: Cd = 0.184 + 0.700 S - 0.555 S^2, Cl = 0.553 S/(0.204 + S); Reynolds numbers up to 2.2e5 occurred.
TOUR_2023 = Air(
    drag=lambda s, re: 0.184 + 0.700 * s - 0.555 * s**2,
    lift=lambda s, re: 0.553 * s / (0.204 + s),
    spin_decay=2.0e-5,
    largest_spin_ratio=0.6,
    largest_reynolds=2.2e5,
    name="tour-2023",
    source="Fitted here to carry, height and angle of descent of TrackMan's averages of 23 clubs of the PGA and "
    "LPGA tours 2023 (bounce.golf.TOUR_AVERAGES), at sea level and 20 degrees C, with the spin decay of "
    "smits-smith: carries differ from the averages by 2 % on average and by 4 % at most, heights by 2 yd, "
    "angles by 3 to 4 degrees. They are of tour players' shots; slow shots and much spin are extrapolations.",
)

#: Coefficients by name.
AIRS = {air.name: air for air in (TOUR_2023, SMITS_SMITH, QUINTAVALLA)}
