"""The errata in order, each a function that derives it again.

Numbers 1 to 24 were known before this reproduction; 25 on were found by it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from . import errata_further as further
from . import errata_general as general
from . import errata_linear as linear
from .records import Erratum

ALL: tuple[Callable[[], Erratum], ...] = (
    linear.contact_velocity,
    linear.restitution,
    linear.overdamped,
    linear.gravity_twice,
    linear.which_is_soft,
    linear.force_scale,
    linear.spin_scale,
    linear.rolling_inequality,
    linear.alpha,
    linear.two_conditions,
    linear.second_lie,
    linear.roll_to_slip_in_compression,
    linear.which_compliance,
    linear.isotropic,
    general.normal_scale,
    general.friction_coefficient,
    general.second_lie_first_line,
    general.nu_product,
    general.visible_condition,
    general.topspin,
    general.normal_form_slips,
    general.slope_variable,
    general.table,
    general.rigid_limit,
    further.gravity_in_impact,
    further.sign_condition,
    further.force_slope,
    further.both_positive,
    further.limit_of_compliance,
)


@cache
def erratum(number: int) -> Erratum:
    """Derive one erratum, from 1 (computed once)."""
    result = ALL[number - 1]()
    if result.number != number:
        raise ValueError(f"erratum {number}: the function in its place derives {result.number}.")
    return result
