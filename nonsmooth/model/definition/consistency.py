"""Whether a definition describes a system: its symbols, its functions, how multipliers enter."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from ..errors import DefinitionError, ParameterError, explain
from ..expressions.cancel import powers
from ..expressions.graph import require_smooth
from ..reading import Parameters, listed, require_finite, require_known, require_unique
from ..values import Array, parameter_values
from .form import Definition
from .vectors import require_linear_sets


def require_consistent(d: Definition, given: bool = True) -> None:
    """Refuse a definition that describes no system."""
    # A section that a system got may have multiple zeros, so that only what is ``given`` must have simple ones.
    guards = [f"stop {n!r}" for n, _ in d.stops] + [f"reset {n!r}" for n, _ in d.resets]
    named = [("field", d.field, True)]
    named += [(f"surface {i}", e, False) for i, e in enumerate(listed(d.surfaces))]
    named += [(name, d.guards[i], False) for i, name in enumerate(guards)]
    named += [(f"map of reset {n!r}", d.maps[:, j], False) for j, (n, _) in enumerate(d.resets)]
    for j, name in enumerate(d.impacts):
        named += [(f"gap of {name!r}", d.gaps[j], False)]
        named += [(f"restitution of {name!r}", d.restitutions[j], False)]
    known = ca.vertcat(d.extended_states, d.parameters, d.multipliers, d.reactions)
    require_unique(known)
    moving = ca.vertcat(d.extended_states, d.multipliers, d.reactions)
    for what, expression, multipliers in named:
        require_known(expression, known, what, **d.names)
        if not multipliers and ca.depends_on(expression, ca.vertcat(d.multipliers, d.reactions)):
            raise DefinitionError(
                f"{what}: expected an expression in states, time and parameters, received one "
                "with a multiplier. Only the field may contain multipliers."
            )
        require_finite(expression, known, what)
        require_smooth(expression, moving, d.parameters, what)
    for i, name in enumerate(guards):
        if not ca.depends_on(d.guards[i], d.extended_states):
            raise DefinitionError(_without_states(name, d.guards[i], d))
        if given:
            _require_simple(name, d.guards[i], d)
    for i, h in enumerate(listed(d.surfaces)):
        if not ca.depends_on(h, d.states):
            raise DefinitionError(_without_states(f"surface {i}", h, d))
        _require_simple(f"surface {i}", h, d)
    for j in range(len(d.impacts)):
        _check_impact(d, j)
    if not d.hidden:
        _require_linear(d)
    require_linear_sets(d)


def _check_impact(d: Definition, j: int) -> None:
    what, gap, rate = f"gap of {d.impacts[j]!r}", d.gaps[j], d.gap_rates[j]
    if not ca.depends_on(gap, d.states):
        raise DefinitionError(_without_states(what, gap, d))
    _require_simple(what, gap, d)
    if ca.depends_on(rate, ca.vertcat(d.multipliers, d.reactions)):
        raise DefinitionError(
            explain(
                what,
                expected="a function of positions, whose rate no multiplier enters",
                received=f"{gap}, with the rate {rate}",
                advice="Forces act on velocities: a gap is a function of positions and time.",
            )
        )
    effect = ca.mtimes(ca.jacobian(rate, d.states), ca.jacobian(d.field, d.reactions[j]))
    if effect.is_zero() or not ca.is_linear(d.field, d.reactions[j]):
        raise DefinitionError(
            explain(
                f"reaction of {d.impacts[j]!r}",
                expected="a multiplier that enters the field linearly and moves the gap's rate",
                received="one that does not move it" if effect.is_zero() else "a nonlinear one",
                advice="Write the force that opens the contact as reaction times its direction.",
            )
        )
    e = d.restitutions[j]
    if e.is_constant() and not 0.0 <= float(e) <= 1.0:
        raise DefinitionError(
            f"restitution of {d.impacts[j]!r}: expected a number from 0 to 1, received {float(e):g}."
        )


def consistent_parameters(
    d: Definition, names: Sequence[str], parameters: Parameters | None
) -> Array:
    """Numbers for all parameters; a restitution that depends on nothing else must be one."""
    p = parameter_values(names, d.defaults, parameters)
    for j, name in enumerate(d.impacts):
        e = d.restitutions[j]
        if e.is_constant() or ca.depends_on(e, d.extended_states):
            continue
        value = float(ca.evalf(ca.substitute(e, d.parameters, ca.DM(p))))
        if not 0.0 <= value <= 1.0:
            raise ParameterError(
                f"restitution of {name!r}: expected a number from 0 to 1, received {value:g} (= {e})."
            )
    return p


def _require_linear(d: Definition) -> None:
    for lam in listed(d.multipliers):
        if not ca.is_linear(d.field, lam):
            raise DefinitionError(
                f"multiplier {lam}: expected a field linear in it (Filippov's convex "
                "combination), received a nonlinear one. Nonlinear multipliers are hidden "
                "dynamics (Jeffrey 2018): say hidden=True if they are meant. Products of "
                "different multipliers are fine."
            )


def _require_simple(what: str, function: ca.SX, d: Definition) -> None:
    """Refuse a power of something that is zero on the surface, as far as it is in sight."""
    x = d.extended_states
    for factor, power in powers(function, x, d.parameters):
        if power > 1 and ca.depends_on(factor, x) and ca.is_linear(factor, x):
            raise DefinitionError(
                explain(
                    what,
                    expected="a function with simple zeros",
                    received=f"{function}, which has the factor {factor} {power} times",
                    advice="Where the gradient vanishes too, the surface cannot be located to "
                    "rounding: use the factor once if the power is odd; an even one does not "
                    "change the sign.",
                )
            )


def _without_states(what: str, function: ca.SX, d: Definition) -> str:
    """Message for a surface, stop or reset that no motion can cross."""
    if d.time.numel() and ca.depends_on(function, d.time):
        received, advice = (
            f"the function {function} of time alone",
            "Make a clock a state: c with c' = 1, started at the time, and the surface a function "
            "of c.",
        )
    else:
        received = f"the constant {function}"
        advice = "A surface is the zero set of a function of the states."
    return explain(
        what,
        expected=f"a function of the states {tuple(d.names['states'])}",
        received=received,
        advice=advice,
    )
