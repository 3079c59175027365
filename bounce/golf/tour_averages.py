"""Averages of tour players' shots with each club, as TrackMan publishes them, beside computed flights."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..errors import require
from ..units import UNITS, Landing
from .air import Air
from .flight import flight

#: Source of the numbers.
SOURCE = (
    "TrackMan, Introducing updated tour averages, 2024-05-02, trackman.com/blog/introducing-updated-tour-averages "
    "(season 2023, competition and range); read from the transcription in github.com/jhoblitt/tmelevation, "
    "site/js/data.js, which agrees with two others. Whole yards, miles per hour and degrees; the air is not stated."
)


class TourAverage(NamedTuple):
    """A launch and what became of it, as published.

    Attributes
    ----------
    club : str
        Its name.
    speed, angle, spin : float
        Of the launch: mph, degrees, rpm.
    height, descent, carry : float
        Largest height in yards, angle of descent in degrees, carry in yards.
    """

    club: str
    speed: float
    angle: float
    spin: float
    height: float
    descent: float
    carry: float

    @property
    def launch(self) -> Landing:
        """The launch, in SI units."""
        speed, angle = self.speed * UNITS["speed"]["mph"], math.radians(self.angle)
        return Landing(speed * math.cos(angle), speed * math.sin(angle), self.spin * math.pi / 30)


_PGA = (
    TourAverage("driver", 171, 10.4, 2545, 35, 39, 282),
    TourAverage("3-wood", 162, 9.3, 3663, 32, 44, 249),
    TourAverage("5-wood", 156, 9.7, 4322, 33, 48, 236),
    TourAverage("hybrid", 149, 10.2, 4587, 31, 49, 231),
    TourAverage("3-iron", 145, 10.3, 4404, 30, 48, 218),
    TourAverage("4-iron", 140, 10.8, 4782, 31, 49, 209),
    TourAverage("5-iron", 135, 11.9, 5280, 33, 50, 199),
    TourAverage("6-iron", 130, 14.0, 6204, 32, 50, 188),
    TourAverage("7-iron", 123, 16.1, 7124, 34, 51, 176),
    TourAverage("8-iron", 118, 17.8, 8078, 33, 51, 164),
    TourAverage("9-iron", 112, 20.0, 8793, 32, 52, 152),
    TourAverage("wedge", 104, 23.7, 9316, 32, 52, 142),
)
_LPGA = (
    TourAverage("driver", 143, 12.6, 2506, 26, 36, 223),
    TourAverage("3-wood", 135, 11.6, 2595, 25, 38, 200),
    TourAverage("5-wood", 130, 12.3, 4320, 25, 43, 189),
    TourAverage("hybrid", 125, 13.9, 4504, 25, 45, 178),
    TourAverage("4-iron", 118, 13.9, 4608, 25, 43, 175),
    TourAverage("5-iron", 114, 14.6, 4966, 25, 45, 166),
    TourAverage("6-iron", 111, 16.7, 5904, 25, 46, 155),
    TourAverage("7-iron", 106, 18.5, 6630, 26, 47, 143),
    TourAverage("8-iron", 102, 20.8, 7413, 27, 47, 133),
    TourAverage("9-iron", 95, 23.5, 7605, 27, 48, 123),
    TourAverage("wedge", 88, 25.2, 8465, 27, 48, 111),
)


#: Averages of 2023 by tour, from the longest club to the shortest.
TOUR_AVERAGES = {"PGA": _PGA, "LPGA": _LPGA}


def tour_differences(air: Air, tour: str = "PGA") -> NDArray[np.float64]:
    """Compare flights with the averages of a tour, for every club.

    Parameters
    ----------
    air : Air
        Coefficients of drag and lift.
    tour : {"PGA", "LPGA"}, optional
        A key of ``TOUR_AVERAGES``.

    Returns
    -------
    ndarray (clubs, 3)
        Computed less published carry (yd), height (yd) and angle of descent (deg).

    Raises
    ------
    nonsmooth.OptionError
        Not air, or another tour.

    Examples
    --------
    >>> from bounce.golf import TOUR_2023, SMITS_SMITH
    >>> [int(abs(tour_differences(air)[:, 0]).max()) for air in (TOUR_2023, SMITS_SMITH)]
    [8, 27]
    """
    require(air, Air, "air", "One of AIRS, for example TOUR_2023.")
    if tour not in TOUR_AVERAGES:
        raise ns.OptionError(f"tour={tour!r} is not one of {list(TOUR_AVERAGES)}.")
    yard, rows = UNITS["length"]["yd"], []
    for club in TOUR_AVERAGES[tour]:
        path = flight(club.launch, air=air)
        found = (path.range / yard, path.height / yard, math.degrees(path.landing.angle))
        rows.append(np.subtract(found, (club.carry, club.height, club.descent)))
    return np.array(rows)
