"""Proven periodic orbits have the period and multipliers of closed forms; others are refused in words."""

import json
from dataclasses import replace
from fractions import Fraction

import casadi as ca
import mpmath
import pytest
from scipy.integrate import solve_ivp

import nonsmooth as ns
from tests.proofs.checking import run

x, v, y, z, d, a, b = (ca.SX.sym(s) for s in ("x", "v", "y", "z", "d", "a", "b"))


def relay(d):
    """x'' + 2 d x' + x = sgn x': a switch at each turn."""
    above, below = [v, 1 - x - 2 * d * v], [v, -1 - x - 2 * d * v]
    parameters = {d: 0.1} if isinstance(d, ca.SX) else {}
    return ns.FilippovSystem([x, v], surface=v, above=above, below=below, parameters=parameters)


CUBIC = ns.FilippovSystem(
    [x, v], surface=x, above=[v, (1 - x**2) * v - x - 0.25], below=[v, (1 - x**2) * v - x + 0.25]
)
LAG = [y - x, z - y, -z]  # 1/(s + 1)^3
THIRD = ns.FilippovSystem(
    [x, y, z], surface=x, above=[*LAG[:2], LAG[2] - 1], below=[*LAG[:2], LAG[2] + 1]
)
KICK = ns.FilippovSystem(
    [x, v], field=[v, -x - 0.1 * v], resets=[ns.Reset(x, [x, v + 0.3], 1, "kick")]
)
HEAT = ns.FilippovSystem(  # warmer from 1/2 to 1, cooler from 1 to 1/2: 2 log(6/5) + 2 log(3/2)
    [x, v],
    field=[v - 0.5 * x, 0 * v],
    resets=[ns.Reset(x - 1, [x, -1], 1, "off"), ns.Reset(x - 0.5, [x, 1], -1, "on")],
)
WARM = ns.FilippovSystem(  # the same, not linear
    [x, v],
    field=[1.5 * v - 0.5 * x**2, 0 * v],
    resets=[ns.Reset(x - 1, [x, -1], 1, "off"), ns.Reset(x - 0.5, [x, 1], -1, "on")],
)
TWIN = [-0.3 * y + x, -0.3 * z + v]  # two states with the same multiplier
DOUBLE = ns.FilippovSystem(
    [x, v, y, z], surface=v, above=[v, 1 - x - 0.2 * v, *TWIN], below=[v, -1 - x - 0.2 * v, *TWIN]
)
DAMPING = 0.75 * (1 + a - b)  # -0.75 between -1 and 1, and 0.75 beyond
VAN_DER_POL = ns.FilippovSystem(
    [x, v], field=[v, -DAMPING * v - x], surfaces=[x - 1, x + 1], multipliers=[a, b]
)
BILINEAR = ns.FilippovSystem(
    [x, v], surface=x, above=[v, -4 * x - 0.875 * v - 0.5], below=[v, 0.25 * v - x - 0.5]
)
STICK = ns.FilippovSystem(
    [x, v], surface=v - 0.5, above=[v, -x - 1], below=[v, 1 - x + 0.2 * v - 0.15]
)
RADIUS = 1 - x**2 - y**2
TOUCH = ns.FilippovSystem(  # 3 x + 4 y = d is a tangent of the circle where d = 5
    [x, y],
    field=[x * RADIUS - y - 0.0 * a * b, y * RADIUS + x],
    surfaces=[y, 3 * x + 4 * y - d],
    multipliers=[a, b],
    parameters={d: 6.0},
)
ROUND = ns.FilippovSystem([x, v], surface=x, above=[v, -x], below=[v, -4 * x])

#: System, guess, and by leg matrix, input, row and value of the switching function that ends it.
AFFINE = {
    "third order": (THIRD, [0.01, 0.29, 0.72], "x"),
    "van der Pol": (VAN_DER_POL, [2.0, 0.0], "x x x x"),
    "bilinear": (BILINEAR, [0.0, 1.0], "x x"),
}


def closed_form(orbit):
    """Period and multipliers of a piecewise affine orbit by exponentials of matrices and Newton's method."""
    system, n = orbit.system, orbit.system.dimension
    legs, surfaces = orbit.legs, system.definition.surfaces
    fields = []
    for leg in legs:
        signs = ca.DM([1.0 if c == "+" else -1.0 for c in leg.mode])
        f = ca.substitute(system.definition.field, system.definition.multipliers, signs)
        A = ca.evalf(ca.jacobian(f, system.definition.states))
        c = ca.evalf(ca.substitute(f, system.definition.states, ca.DM.zeros(n)))
        fields.append((mpmath.matrix(A.full().tolist()), mpmath.matrix(c.full().tolist())))
    rows = mpmath.matrix(ca.evalf(ca.jacobian(surfaces, system.definition.states)).full().tolist())
    values = ca.evalf(ca.substitute(surfaces, system.definition.states, ca.DM.zeros(n))).full()

    def flow(A, c, t):
        big = mpmath.zeros(n + 1)
        big[:n, :n], big[:n, n] = A * t, c * t
        return mpmath.expm(big)

    def legwise(unknowns):
        at, left, product = mpmath.matrix(unknowns[:n]), [], mpmath.eye(n)
        for k, (leg, (A, c), t) in enumerate(zip(legs, fields, unknowns[n:], strict=True)):
            E = flow(A, c, t)
            at, X = E[:n, :n] * at + E[:n, n], E[:n, :n]
            row = rows[leg.element, :]
            left.append((row * at)[0] + float(values[leg.element, 0]))
            before, (B, e) = A * at + c, fields[(k + 1) % len(fields)]
            jump = (B * at + e - before) * row / (row * before)[0]
            product = (mpmath.eye(n) + jump) * X * product
        return at, left, product

    def equations(*unknowns):
        at, left, _ = legwise(unknowns)
        return [*left, *(at[i] - unknowns[i] for i in range(n))]

    guess = [*orbit.legs[0].start.tolist(), *(leg.duration for leg in legs)]
    found = mpmath.findroot(equations, guess)
    multipliers = mpmath.eig(legwise(list(found))[2], left=False, right=False)
    return sum(found[n:]), sorted(multipliers, key=abs, reverse=True)


def holds(enclosure, truth, slack=1e-19):
    return mpmath.mpf(enclosure.low) - slack <= truth <= mpmath.mpf(enclosure.high) + slack


@pytest.mark.slow_cases("van der Pol", "third order")
@pytest.mark.parametrize("name", AFFINE)
def test_piecewise_affine_orbits_have_the_closed_form(name):
    system, guess, _ = AFFINE[name]
    orbit = ns.periodic_orbit(system, guess=guess)
    with mpmath.workdps(30):
        proof = ns.certify(orbit)
        period, multipliers = closed_form(orbit)
        assert proof.proven and proof.label == "asymptotically stable", proof
        assert holds(proof.values["period"], period) and proof.values["period"].radius < 1e-15
        for k in range(2, orbit.system.dimension + 1):
            value = proof.values[f"multiplier{k}"]
            assert value.radius < 1e-13 and any(holds(value, m.real) for m in multipliers)


#: Values of closed forms, 20 digits.
KNOWN = {
    "relay": (relay(0.1), [-6.38, 0.01], "6.3148388339965529095", "0.53180208294425965119"),
    "kick": (KICK, [-0.1, 0.8], "6.2910540457760034274", "0.73011538017940582909"),
    "heat": (HEAT, [0.625, 1.0], "1.1755733298042381", "0"),
}


@pytest.mark.parametrize("name", KNOWN)
def test_period_and_multiplier_are_those_of_the_closed_form(name):
    system, guess, period, multiplier = KNOWN[name]
    proof = ns.certify(ns.periodic_orbit(system, guess=guess), width=1e-18)
    with mpmath.workdps(40):
        # 0.1 is stored as a double, 5e-18 from one tenth.
        slack = 1e-15
        assert proof.proven and proof.values["period"].radius < 1e-20
        assert holds(proof.values["period"], mpmath.mpf(period), slack)
        assert holds(proof.values["multiplier2"], mpmath.mpf(multiplier), slack)
        assert all(box.radius > 1e-3 for box in proof.box.values())


@pytest.mark.slow
def test_a_theorem_holds_for_all_values_of_a_parameter():
    orbit = ns.periodic_orbit(relay(d), guess=[-6.38, 0.01])
    proof = ns.certify(orbit, parameters={"d": ("0.1", "0.1002")})
    assert proof.proven, proof
    for d_ in (0.1, 0.1001, 0.1002):
        w = mpmath.sqrt(1 - d_ * d_)
        assert holds(proof.values["period"], 2 * mpmath.pi / w)
        assert holds(proof.values["multiplier2"], mpmath.exp(-2 * mpmath.pi * d_ / w))


def moved(orbit, **changes):
    """The orbit with other numbers."""
    at = orbit.evaluation
    return replace(
        orbit, evaluation=replace(at, **{k: getattr(at, k) + by for k, by in changes.items()})
    )


REFUSED = {
    "start": (relay(0.1), [-6.38, 0.01], {"starts": 1e-3}, {}, "away from the given one"),
    "period": (relay(0.1), [-6.38, 0.01], {"durations": 1e-3}, {}, "away from the given one"),
    "slides": (STICK, [0.0, 0.0], {}, {}, "slides"),
    "touches": (TOUCH, [1.0, 0.01], {}, {"d": 5}, "undecided"),
    "one of many": (ROUND, [0.0, 1.0], {}, {}, "a multiplier is 1"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_other_orbits_are_refused_in_words(name):
    system, guess, changes, parameters, words = REFUSED[name]
    orbit = moved(ns.periodic_orbit(system, guess=guess), **changes)
    proof = ns.certify(orbit, parameters=parameters, max_bits=128)
    assert not proof.proven and not proof.exists and words in str(proof).replace("\n ", ""), proof


def test_what_is_given_wrongly_is_refused():
    orbit = ns.periodic_orbit(relay(0.1), guess=[-6.38, 0.01])
    with pytest.raises(ns.OptionError, match="hold"):
        ns.certify(orbit, hold=["x"])
    with pytest.raises(ns.ParameterError, match="mu"):
        ns.certify(orbit, parameters={"mu": 1})


# The checker -------------------------------------------------------------------------------------


def test_the_checker_proves_the_orbit_again(tmp_path):
    path = tmp_path / "orbit.json"
    ns.certify(ns.periodic_orbit(relay(0.1), guess=[-6.38, 0.01])).save(path)
    code, words = run(path)
    assert code == 0 and "checked: exactly one periodic orbit" in words and "stable" in words


def altered(record):
    """False statements made of a true one."""
    claims = record["claims"]
    shifted = lambda pair, by: [str(Fraction(e) + Fraction(by)) for e in pair]
    claim = lambda **new: {**record, "claims": {**claims, **new}}
    yield claim(label="unstable, 1 multiplier outside the unit circle")
    yield claim(period=shifted(claims["period"], "1e-12"))
    (re, im), *others = claims["multipliers"]
    yield claim(multipliers=[[shifted(re, "1e-9"), im], *others])
    yield claim(multipliers=others)
    yield claim(events=[*claims["events"][:-1], []])
    yield claim(events=[[[kind, name, "s"] for kind, name, _ in e] for e in claims["events"]])
    yield {**record, "box": [["-9", "9"]] * len(record["box"])}
    yield {**record, "matrix": [["0"] * len(row) for row in record["matrix"]]}
    yield {**record, "point": [shifted(pair, "1e-9") for pair in record["point"]]}
    first, *more = record["sections"]
    for key, value in (("value", "1"), ("direction", -first["direction"]), ("mode", "+")):
        yield {**record, "sections": [first | {key: value}, *more]}
    yield {**record, "sections": [first, *more, first]}
    nodes = [["const", "5/11"] if n == ["const", "1/2"] else n for n in record["graph"]["nodes"]]
    yield {**record, "graph": {**record["graph"], "nodes": nodes}}


@pytest.mark.slow
def test_orbits_are_checked_and_altered_ones_are_not(tmp_path):
    orbits = (
        [THIRD, [0.01, 0.29, 0.72]],
        [DOUBLE, [-6.38, 0.01, 0, 0]],
        [WARM, [0.625, 1.0]],
        [HEAT, [0.625, 1.0]],
    )
    records = [ns.certify(ns.periodic_orbit(s, guess=g)).record for s, g in orbits]
    true, false = tmp_path / "true.json", tmp_path / "false.json"
    true.write_text(json.dumps({"proofs": records}))
    code, words = run(true)
    assert code == 0 and words.count("checked: exactly one") == len(records), words
    wrong = [*altered(json.loads(json.dumps(records[-1])))]
    false.write_text(json.dumps({"proofs": wrong}))
    words = run(false)[1]
    assert words.count("NOT CHECKED") == len(wrong), words


@pytest.mark.slow
def test_a_nonlinear_orbit_agrees_with_another_integrator():
    proof = ns.certify(ns.periodic_orbit(CUBIC, guess=[2.0, 0.0]))
    field = lambda t, s: [s[1], (1 - s[0] ** 2) * s[1] - s[0] - 0.25 * (1 if s[0] > 0 else -1)]
    back = lambda t, s: s[0] if t > 0.1 else 1.0
    back.terminal = True
    speed, time = 2.0, 0.0
    for _ in range(8):  # halves, mirrored
        half = solve_ivp(field, (0, 9), [0, speed], "DOP853", rtol=1e-13, atol=1e-14, events=back)
        speed, time = -half.y_events[0][0][1], half.t_events[0][0]
    assert proof.proven and proof.values["period"].middle == pytest.approx(2 * time, abs=1e-10)
