"""Proven periodic orbits have the period and multipliers of closed forms; others are refused in words."""

import json
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction

import casadi as ca
import mpmath
import pytest
from scipy.integrate import solve_ivp

import nonsmooth as ns
from nonsmooth.proofs.orbits.forcing import forcing_period
from nonsmooth.proofs.orbits.modes import Modes
from tests.proofs.checking import CHECKER, checked, run_records
from tests.proofs.systems import holds

x, v, y, z, d, a, b, t = (ca.SX.sym(s) for s in ("x", "v", "y", "z", "d", "a", "b", "t"))


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
LATE = ns.FilippovSystem(  # intervals that forget the frame of a set grow by exp(75) in each leg
    [x, v, y],
    surface=v,
    above=[v, 1 - x - 0.2 * v, x - 24 * y],
    below=[v, -1 - x - 0.2 * v, x - 24 * y],
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


@pytest.mark.slow_cases("van der Pol", "third order")
@pytest.mark.parametrize("name", AFFINE)
def test_piecewise_affine_orbits_have_the_closed_form(name):
    system, guess, _ = AFFINE[name]
    orbit = ns.periodic_orbit(system, guess=guess)
    with mpmath.workdps(30):
        proof = ns.certify(orbit)
        period, multipliers = closed_form(orbit)
        assert proof.proven and proof.label == "asymptotically stable", proof
        assert (
            holds(proof.values["period"], period, 1e-19) and proof.values["period"].radius < 1e-15
        )
        for k in range(2, orbit.system.dimension + 1):
            value = proof.values[f"multiplier{k}"]
            assert value.radius < 1e-13 and any(holds(value, m.real, 1e-19) for m in multipliers)


PASSENGERS = [-40 * y + x, 5 * z + v]  # LM1 of the reference cases: multipliers from 2e-110 to 5e13
STIFF = ns.FilippovSystem(
    [x, v, y, z],
    surface=v,
    above=[v, 1 - x - 0.2 * v, *PASSENGERS],
    below=[v, -1 - x - 0.2 * v, *PASSENGERS],
)

#: System, guess, and values of closed forms, 20 digits: period, multipliers by size; least radius of the box.
KNOWN = {
    "relay": (
        *(relay(0.1), [-6.38, 0.01], "6.3148388339965529095"),
        *(["0.53180208294425965119"], 0.2),
    ),
    "kick": (KICK, [-0.1, 0.8], "6.2910540457760034274", ["0.73011538017940582909"], 0.01),
    "heat": (HEAT, [0.625, 1.0], "1.1755733298042381", ["0"], 0.03),
    "stiff": (
        *(STIFF, [-6.3868231843577333, 0.01, -0.15958604063869290, -0.27358603355134122]),
        "6.3148388339965529095",
        ["51582014424075.48989", "0.53180208294425965119", "1.9953248506316915178e-110"],
        1e-8,
    ),
}


@pytest.mark.slow_cases("stiff")
@pytest.mark.parametrize("name", KNOWN)
def test_period_and_multipliers_are_those_of_the_closed_form(name):
    system, guess, period, multipliers, box = KNOWN[name]
    orbit = ns.periodic_orbit(system, guess=guess)
    proof = ns.certify(orbit, width=1e-18, numbers="written")
    with mpmath.workdps(40):
        assert proof.proven and proof.values["period"].radius < 1e-20
        assert holds(proof.values["period"], mpmath.mpf(period), 1e-15 if name == "heat" else 1e-18)
        for k, multiplier in enumerate(multipliers, 2):
            value = mpmath.mpf(multiplier)
            assert holds(proof.values[f"multiplier{k}"], value, 1e-18 * max(1, value))
        assert all(side.radius > box for side in proof.box.values())


# Forcing ------------------------------------------------------------------------------------------


def forced(field, **options):
    """A system that depends on time."""
    return ns.FilippovSystem([x], field=[field], time=t, **options)


FRICTION = ns.FilippovSystem(
    [x],
    surface=x,
    above=[3 * ca.cos(t) - x / 2 - 1],
    below=[3 * ca.cos(t) - x / 2 + 1],
    time=t,
)
BEATS = forced(-x + ca.sin(0.7 * t) + ca.cos(2.1 * t))


def friction_values():
    """Symmetric orbit of FRICTION: x = 1.2 cos t + 2.4 sin t - 2 + C exp(-t/2) from zero to zero in pi."""
    q = mpmath.exp(-mpmath.pi / 2)
    u = -2 * (1 - q) / (1 + q)
    start = mpmath.findroot(lambda s: (6 * mpmath.cos(s) + 12 * mpmath.sin(s)) / 5 - u, -1)
    rate = 3 * mpmath.cos(start)
    return 2 * mpmath.pi, [(q * (rate - 1) / (rate + 1)) ** 2]


#: System, guess, how constants are read, and as functions of nothing the period and multipliers.
FORCED = {
    "friction": (FRICTION, [1.0], "written", 1, friction_values),
    "no events": (
        *(forced(-x + ca.sin(2 * t)), [0.0], "stored", 1),
        lambda: (mpmath.pi, [mpmath.exp(-mpmath.pi)]),
    ),
    "two frequencies": (
        *(BEATS, [0.0], "written", 1),
        lambda: (20 * mpmath.pi / 7, [mpmath.exp(-20 * mpmath.pi / 7)]),
    ),
}


@pytest.mark.parametrize("name", FORCED)
def test_forced_orbits_have_the_period_of_the_forcing_and_the_multipliers_of_closed_forms(name):
    system, guess, numbers, multiplicity, values = FORCED[name]
    proof = ns.certify(ns.periodic_orbit(system, guess=guess), numbers=numbers, width=1e-18)
    with mpmath.workdps(40):
        period, multipliers = values()
        assert proof.proven and f"It takes {multiplicity} of the forcing's periods" in str(proof)
        assert holds(proof.values["period"], period, 0) and proof.values["period"].radius < 1e-30
        for k, multiplier in enumerate(multipliers, 1):
            assert holds(proof.values[f"multiplier{k}"], multiplier, 1e-30)
            assert proof.values[f"multiplier{k}"].radius < 1e-18


#: Functions of the time, and their period over pi, or why they have none.
PERIODS = {
    ca.sin(t): 2,
    ca.cos(2 * t) + ca.sin(3 * t): 2,
    ca.cos(d * t + x) + ca.sin(3 * d * t / 2): 2,
    ca.sin(-4 * (t + 1) / d): 1,
    ca.exp(ca.sin(t / 3)) / (2 + ca.cos(t)): 6,
    ca.sin(t + ca.cos(t)) + (t + 1) * x - t * x: 2,
    ca.sin(t) ** 2 + t: "phases",
    ca.sin(t * t): "phases",
    ca.sin(x * t): "phases",
    ca.tan(t): "phases",
    ca.sin(t) + ca.cos(d * t): "no rational ratio",
    0 * ca.sin(t) + t - t + x: "no sine",
}


@pytest.mark.parametrize("expression", PERIODS)
def test_periods_of_forcings_follow_from_their_instructions(expression):
    system = forced(-x + expression + 0 * t, parameters={d: 2.0})
    modes = Modes(system, "stored")
    if isinstance(PERIODS[expression], str):
        with pytest.raises(ns.proofs.UnprovenError, match=PERIODS[expression]):
            forcing_period(modes)
        return
    period = modes.constant(forcing_period(modes), [(Fraction(2), Fraction(2))])
    assert abs(float(period.mid())) == pytest.approx(PERIODS[expression] * mpmath.pi, rel=1e-15)


def test_the_period_of_a_forcing_may_have_a_range():
    system = forced(-x + ca.sin(d * t), parameters={d: 2.0})
    orbit = ns.periodic_orbit(system, guess=[0.0])
    proof = ns.certify(orbit, parameters={"d": ("2", "2.001")})
    assert proof.proven and all(
        holds(proof.values["period"], 2 * mpmath.pi / w, 1e-19) for w in (2, 2.0005, 2.001)
    )
    zero = ns.certify(orbit, parameters={"d": (-1, 1)})
    assert not zero.exists and "is not finite" in str(zero).replace("\n ", "")


@pytest.mark.slow
def test_a_theorem_holds_for_all_values_of_a_parameter():
    orbit = ns.periodic_orbit(relay(d), guess=[-6.38, 0.01])
    proof = ns.certify(orbit, parameters={"d": ("0.1", "0.1002")})
    assert proof.proven, proof
    for d_ in (0.1, 0.1001, 0.1002):
        w = mpmath.sqrt(1 - d_ * d_)
        assert holds(proof.values["period"], 2 * mpmath.pi / w, 1e-19)
        assert holds(proof.values["multiplier2"], mpmath.exp(-2 * mpmath.pi * d_ / w), 1e-19)


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
    "no ratio": (BEATS, [0.0], {}, {}, "not a whole number"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_other_orbits_are_refused_in_words(name):
    system, guess, changes, parameters, words = REFUSED[name]
    orbit = moved(ns.periodic_orbit(system, guess=guess), **changes)
    proof = ns.certify(orbit, parameters=parameters, max_bits=64)
    assert not proof.proven and not proof.exists and words in str(proof).replace("\n ", ""), proof


def test_what_is_given_wrongly_is_refused():
    orbit = ns.periodic_orbit(relay(0.1), guess=[-6.38, 0.01])
    with pytest.raises(ns.OptionError, match="hold"):
        ns.certify(orbit, hold=["x"])
    with pytest.raises(ns.ParameterError, match="mu"):
        ns.certify(orbit, parameters={"mu": 1})


# The checker -------------------------------------------------------------------------------------


def test_the_checker_proves_the_orbit_again(tmp_path):
    proof = ns.certify(ns.periodic_orbit(relay(0.1), guess=[-6.38, 0.01]))
    code, words = checked(proof, tmp_path / "orbit.json")
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
        [FRICTION, [1.0]],
        [HEAT, [0.625, 1.0]],
    )
    records = [ns.certify(ns.periodic_orbit(s, guess=g)).record for s, g in orbits]
    code, words = run_records(records, tmp_path)
    assert code == 0 and words.count("checked: exactly one") == len(records), words
    wrong = [*altered(json.loads(json.dumps(records[-1])))]
    friction = records[-2]
    wrong += [{**friction, "multiplicity": k} for k in (0, 2, -1, "1")]
    nodes = [["const", "2"] if n == ["const", "3"] else n for n in friction["graph"]["nodes"]]
    tangent = [["tan", *n[1:]] if n[0] == "cos" else n for n in friction["graph"]["nodes"]]
    wrong += [{**friction, "graph": {**friction["graph"], "nodes": n}} for n in (nodes, tangent)]
    words = run_records(wrong, tmp_path)[1]
    assert words.count("NOT CHECKED") == len(wrong), words


@pytest.mark.slow
def test_the_checker_follows_points_in_frames_where_intervals_grow(tmp_path):
    path = tmp_path / "late.json"
    ns.certify(ns.periodic_orbit(LATE, guess=[-6.38, 0.01, -0.7])).save(path)
    code = (
        f"import sys; sys.path.insert(0, {str(CHECKER)!r}); from records import read; "
        "from periodic_orbits import UNIT, Iv, Pieces; "
        f"record = read({str(path)!r})['proofs'][0]; pieces = Pieces(record); "
        "end, *_ = pieces.piece(0, [Iv.of(*p).mid() for p in record['point'][:2]]); "
        "print(max(v.b - v.a for v in end) / UNIT)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 1e-20


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
