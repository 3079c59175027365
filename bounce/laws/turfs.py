"""Published values of laws for turf, with their sources."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .law import BounceLaw, LandingRange
from .rigid import RigidBounce
from .tilted import PennerBounce, TiltedBounce


@dataclass(frozen=True)
class PublishedFit:
    """A law with published values.

    Attributes
    ----------
    law : BounceLaw
        The law with the published values.
    source : str
        Where they were published.
    checked : str
        What the values here were compared with.
    """

    law: BounceLaw
    source: str
    checked: str


_BIBER = (
    "Biber, Jones, Champneys, Green & Szalai 2023, Measurements and linearized models for golf ball "
    "bounce on a green, Sports Engineering 26 (arXiv 2302.02758), {}"
)
_RANGES = (
    "Biber, Champneys & Szalai 2022, Table ics, the ranges of the same experiments; its largest spins, "
    "printed in rpm, lack a zero that its rad/s have"
)
_RPM = math.pi / 30
_NATURAL = LandingRange((0.0171, 36.8), (2.14, 33.0), (-3880 * _RPM, 10900 * _RPM), _RANGES)
_ARTIFICIAL = LandingRange((1.53, 38.6), (4.61, 36.4), (-4550 * _RPM, 10400 * _RPM), _RANGES)
_PENNER = LandingRange(
    (13.0, 24.9),
    (10.0, 18.2),
    (0.0, 315.0),
    "Penner 2002: the hull of the impact that the tilt was fitted to (18.6 m/s, 44.4 deg from the "
    "vertical) and of the two worked drives (p. 936), with spins up to theirs",
)
_QUOTED = "As quoted by public golf simulators; the paper itself was not at hand."

#: Published laws by name, for golf balls in m/s. The piecewise-affine map of Biber et al. 2023 is
#: not among them: its coefficients were not at hand.
TURFS: dict[str, PublishedFit] = {
    "natural": PublishedFit(
        TiltedBounce(mu=0.998, restitution=0.147, tilt=math.radians(18.4)).covering(_NATURAL),
        _BIBER.format("Table 3, fixed beta, natural teeing turf, 693 bounces"),
        _QUOTED,
    ),
    "artificial": PublishedFit(
        TiltedBounce(mu=0.852, restitution=0.420, tilt=math.radians(12.9)).covering(_ARTIFICIAL),
        _BIBER.format("Table 3, fixed beta, artificial turf"),
        _QUOTED,
    ),
    "natural-rigid": PublishedFit(
        RigidBounce(mu=0.998, restitution=0.260).covering(_NATURAL),
        _BIBER.format("untilted, natural turf"),
        _QUOTED,
    ),
    "artificial-rigid": PublishedFit(
        RigidBounce(mu=0.997, restitution=0.544).covering(_ARTIFICIAL),
        _BIBER.format("untilted, artificial turf"),
        _QUOTED,
    ),
    "penner": PublishedFit(
        PennerBounce().covering(_PENNER),
        "Penner 2002, The run of a golf ball, Can. J. Phys. 80, 931",
        "As quoted by public golf simulators; reproduces the paper's two worked heights (p. 936).",
    ),
}
