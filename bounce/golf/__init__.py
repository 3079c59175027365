"""The whole shot in SI units: launch, flight, bounces, roll; measured bounces and fits to them.

``flight(launch, air=...)`` flies a ball to the ground; ``play(ground, landing)`` follows it from
there to rest; ``rebound`` is one bounce. The ground is a law of ``bounce.laws``, such as
``bounce.laws.TURFS["natural"].law``, or a contact model with the ``bounce.Scaling`` that gives its
numbers their units. A launch or landing is a ``bounce.Landing`` in a vertical plane, or a ``SideState``
with side spin. ``read_measurements`` reads measured bounces, ``fit`` finds the parameters behind them.
Speeds are m/s, spins rad/s, angles rad.

Examples
--------
>>> import bounce, math
>>> launch = bounce.Landing(70 * math.cos(0.19), 70 * math.sin(0.19), 283.0)
>>> carry = bounce.golf.flight(launch, air=bounce.golf.SMITS_SMITH)
>>> run = bounce.golf.play(bounce.laws.TURFS["natural"].law, carry.landing)
>>> f"carry {carry.range:.0f} m, then {run.run_out:.0f} m in {len(run.bounces)} bounces"
'carry 215 m, then 19 m in 12 bounces'
"""

import nonsmooth as ns

from ..units import GOLF
from .air import AIRS, QUINTAVALLA, SMITS_SMITH, TOUR_2023, Air
from .fits.columns import DataError
from .fits.fit_result import FitResult, IdentifiabilityWarning
from .fits.fitting import fit
from .fits.least_squares import Start
from .fits.measurements import Measurements, read_measurements
from .fits.predictions import FitError
from .flight import Flight, flight
from .ground import ExtrapolationWarning, Rebound, rebound
from .maps import landing_map
from .rollout import GREEN_ROLLING_FRICTION, Bounce, Glide, NoRestError, Run, play
from .side_spin import AxisSpin, SideState, axis_spin
from .tour_averages import TOUR_AVERAGES, TourAverage, tour_differences

__all__ = [
    "AIRS",
    "GOLF",
    "GREEN_ROLLING_FRICTION",
    "QUINTAVALLA",
    "SMITS_SMITH",
    "TOUR_2023",
    "TOUR_AVERAGES",
    "Air",
    "AxisSpin",
    "Bounce",
    "DataError",
    "ExtrapolationWarning",
    "FitError",
    "FitResult",
    "Flight",
    "Glide",
    "IdentifiabilityWarning",
    "Measurements",
    "NoRestError",
    "Rebound",
    "Run",
    "SideState",
    "Start",
    "TourAverage",
    "axis_spin",
    "fit",
    "flight",
    "landing_map",
    "play",
    "read_measurements",
    "rebound",
    "tour_differences",
]

ns.result_tables.add_views(globals(), __all__)
