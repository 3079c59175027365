"""Orbits of reference of systems on whose surfaces nothing slides: they close, with their multipliers."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import cases_of

CASES = {
    name: case
    for name, case in cases_of("cases/continuous_switching.json").items()
    if case["start"] and case["t_end"] and "mu" not in case["start"][-1] and name != "dcm_ramp_0.3"
}
PARAMETERS = ("A", "w", "I", "al", "a", "q")


def build(case):
    of, values = case["system"], case["values"]
    symbols = {s: ca.SX.sym(s) for s in (*of["states"], *of.get("multipliers", ()))}
    known = {k: float(values[k]) for k in PARAMETERS if k in values}
    known |= {"cos": ca.cos, "ph": float(values.get("forcing_phase_at_start", 0.0)), **symbols}
    more = {}
    if "time" in of:
        more["time"] = known[of["time"]] = ca.SX.sym(of["time"])
    for name, text in of.get("where", {}).items():
        known[name] = eval(text, {}, known)

    def read(rows):
        return [eval(text, {}, known) for text in rows]

    states = [symbols[s] for s in of["states"]]
    if "above" in of:
        (surface,), above, below = (read(of[k]) for k in ("surfaces", "above", "below"))
        return ns.FilippovSystem(states, surface=surface, above=above, below=below, **more)
    lam = [symbols[s] for s in of["multipliers"]]
    field, surfaces = read(of["field"]), read(of["surfaces"])
    return ns.FilippovSystem(states, field=field, surfaces=surfaces, multipliers=lam, **more)


def multipliers_of(values):
    given = values.get("multipliers", values.get("multiplier"))
    if isinstance(given, str) and "+-" in given:
        real, imaginary = given.rstrip("i").split("+-")
        given = [f"{real.strip()}+{imaginary.strip()}i", f"{real.strip()}-{imaginary.strip()}i"]
    given = [given] if isinstance(given, str) else given
    return [complex(text.replace(" ", "").replace("i", "j")) for text in given]


@pytest.mark.parametrize("name", CASES)
def test_an_orbit_closes_with_its_multipliers(name):
    case = CASES[name]
    system, start = build(case), [float(s) for s in case["start"]]
    run = ns.simulate(system, start, float(case["t_end"]), tol=1e-13)
    np.testing.assert_allclose(run.x[-1], start, atol=1e-11)
    orbit = ns.periodic_orbit(system, start)
    assert orbit.period == pytest.approx(float(case["t_end"]), rel=1e-11)
    for value in multipliers_of(case["values"]):
        assert np.abs(orbit.multipliers - value).min() < 3e-8 * max(1.0, abs(value))
