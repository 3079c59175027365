"""Bounce laws in closed form: rigid impact, the laws in use today, and values for turf.

A law takes xdot, ydot and the surface speed of the spin (spin times radius) at touch-down, in one
unit of speed (m/s where the law has a speed in it), and gives them at lift-off: no contact that
takes time, no further parameters of a ground. :class:`RigidBounce` is rigid impact with Coulomb
friction; the others change one thing of it: the plane of the impact is tilted (Penner 2002, Biber
et al. 2023), or the slip is thrown back (Cross 2002).

Examples
--------
>>> import bounce
>>> law = bounce.laws.TURFS["artificial"].law
>>> shot = law.lift_off(xdot=22.7, ydot=-17.3, omega=4.7)
>>> f"{float(shot.xdot):.2f} m/s along the ground, {float(shot.ydot):.2f} m/s up"
'9.35 m/s along the ground, 11.59 m/s up'
"""

from ..contact.models import kelvin_voigt_restitution
from .cross import CrossBounce
from .law import BounceLaw, LandingRange, RigidShot
from .rigid import RigidBounce, rigid_lift_off_3d
from .tilted import PennerBounce, TiltedBounce, penner_restitution, penner_tilt
from .turfs import TURFS, PublishedFit

__all__ = [
    "TURFS",
    "BounceLaw",
    "CrossBounce",
    "LandingRange",
    "PennerBounce",
    "PublishedFit",
    "RigidBounce",
    "RigidShot",
    "TiltedBounce",
    "kelvin_voigt_restitution",
    "penner_restitution",
    "penner_tilt",
    "rigid_lift_off_3d",
]
