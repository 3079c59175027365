"""classify names every class of random planar systems built with a known answer, or says degenerate.

One system with parameters serves all draws: normal forms with random higher-order terms, bent by a
random nonlinear change of coordinates, with h and both fields multiplied by positive functions,
sides swapped and time reversed at random.
"""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.local import classify

POWERS = [(i, j) for d in range(4) for i in range(d + 1) for j in [d - i]]


def make_system():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    names = []

    def parameters(name, count):
        symbols = [ca.SX.sym(f"{name}{k}") for k in range(count)]
        names.extend(symbols)
        return symbols

    x0, p, q = parameters("x0_", 2), parameters("p", 4), parameters("q", 6)
    v, w = x - x0[0], y - x0[1]
    square = [v**2, v * w, w**2]
    u1 = p[0] * v + p[1] * w + sum(c * s for c, s in zip(q[:3], square, strict=True))
    u2 = p[2] * v + p[3] * w + sum(c * s for c, s in zip(q[3:], square, strict=True))
    back = ca.inv(ca.jacobian(ca.vertcat(u1, u2), ca.vertcat(x, y)))
    fields = []
    for side in "ab":
        scale = parameters(f"c{side}", 2)
        parts = []
        for component in "uv":
            c = parameters(f"{component}{side}", len(POWERS))
            parts.append(sum(k * u1**i * u2**j for k, (i, j) in zip(c, POWERS, strict=True)))
        fields.append(ca.exp(scale[0] + scale[1] * (u1 + u2)) * ca.mtimes(back, ca.vertcat(*parts)))
    m = parameters("m", 2)
    return ns.FilippovSystem(
        [x, y],
        surface=ca.exp(m[0] + m[1] * u1) * u2,
        above=ca.vertsplit(fields[0]),
        below=ca.vertsplit(fields[1]),
        parameters=names,
    )


SYSTEM = make_system()


class Draw:
    """Random coefficients: ``f[k][c]`` is a dict from powers to numbers for field k, component c."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.f = [[self._dict(), self._dict()] for _ in (0, 1)]
        self.swapped = self.reversed = False

    def _dict(self):
        return dict(zip(POWERS, self.rng.normal(size=len(POWERS)), strict=True))

    def some(self, sign=0):
        """A number between 0.3 and 2, of a given or random sign."""
        sign = sign or self.rng.choice([-1, 1])
        return float(sign * self.rng.uniform(0.3, 2.0))

    def linear(self, k, matrix):
        for c in (0, 1):
            f = self.f[k][c]
            f[0, 0], (f[1, 0], f[0, 1]) = 0.0, matrix[c]

    def constant(self, k, vector):
        self.f[k][0][0, 0], self.f[k][1][0, 0] = vector

    def matrix(self):
        """The linear part of the first field."""
        return np.array([[self.f[0][c][1, 0], self.f[0][c][0, 1]] for c in (0, 1)])

    def push_by(self, s, e2):
        """The second field (e1, e2) at the point, with s = (A^-1 E)_2."""
        inverse = np.linalg.inv(self.matrix())
        self.constant(1, ((s - inverse[1, 1] * e2) / inverse[1, 0], e2))

    def swap(self):
        """Mirror u2 -> -u2: the fields change sides, the class stays."""
        self.f.reverse()
        for field in self.f:
            for c, sign in ((0, 1), (1, -1)):
                field[c] = {(i, j): sign * (-1) ** j * v for (i, j), v in field[c].items()}
        self.swapped = not self.swapped

    def reverse(self):
        for field in self.f:
            for c in (0, 1):
                field[c] = {k: -v for k, v in field[c].items()}
        self.reversed = not self.reversed

    def bend(self, at=(0.0, 0.0)):
        """Parameters of a bent and scaled system, and the state where u = ``at``."""
        rng = self.rng
        turn, squeeze = rng.uniform(0, 2 * np.pi, 2), np.diag(rng.uniform(0.5, 2.0, 2))
        r1, r2 = (np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]) for t in turn)
        p, q, x0 = r1 @ squeeze @ r2, rng.normal(size=6) * 0.3, rng.normal(size=2)
        values = [*x0, *p.ravel(), *q]
        for field in self.f:
            values += [*rng.normal(size=2) * 0.5, *field[0].values(), *field[1].values()]
        values += list(rng.normal(size=2) * 0.5)
        x = x0.copy()
        for _ in range(30 if any(at) else 0):  # Newton on u(x) = at
            v, w = x - x0
            square, d = np.array([v * v, v * w, w * w]), np.array([[2 * v, 0], [w, v], [0, 2 * w]])
            u = p @ (x - x0) + np.array([q[:3] @ square, q[3:] @ square])
            x = x - np.linalg.solve(p + np.array([q[:3] @ d, q[3:] @ d]), u - np.asarray(at))
        return x, dict(zip(SYSTEM.parameter_names, values, strict=True))

    def classify(self, at=(0.0, 0.0), **options):
        x, parameters = self.bend(at)
        return classify(SYSTEM, x, parameters=parameters, **options)


# builders: change the draw's coefficients and return (kind, label, side) ------------------------


def crossing(d, up):
    d.f[0][1][0, 0], d.f[1][1][0, 0] = d.some(up), d.some(up)
    return "crossing", "crossing up" if up > 0 else "crossing down", ""


def sliding(d, attracting):
    d.f[0][1][0, 0], d.f[1][1][0, 0] = d.some(-attracting), d.some(attracting)
    a1, a2 = d.f[0][0], d.f[1][0]
    a1[0, 0] = a2[0, 0] = d.some()  # both fields the same way along the surface: it moves
    return "sliding", "attracting sliding" if attracting > 0 else "repelling sliding", ""


def fold(d, visible):
    a = d.some()
    d.f[0][0][0, 0], d.f[0][1][0, 0] = a, 0.0
    d.f[0][1][1, 0] = np.sign(a) * d.some(visible)
    d.f[1][1][0, 0] = d.some()
    return "fold", "visible" if visible > 0 else "invisible", "+"


def cusp(d):
    d.f[0][0][0, 0], d.f[0][1][0, 0], d.f[0][1][1, 0], d.f[0][1][2, 0] = d.some(), 0, 0, d.some()
    d.f[1][1][0, 0] = d.some()
    return "cusp", "cusp", "+"


def fold_fold(d, label):
    visible = {"V": (1, -1), "I": (-1, 1)}
    same = label[2] == "1"
    a = [d.some(), d.some()]
    a[1] = abs(a[1]) * np.sign(a[0]) * (1 if same else -1)
    l11, l22 = visible[label[0]][0] * d.some(1), visible[label[1]][1] * d.some(1)
    b = [l11 / a[0], l22 / a[1]]
    if label in ("VI2", "VI3"):  # F1 visible: VI2 iff |a2 b1| > |a1 b2|
        larger = 1.2 * abs(a[0] * b[1]) / abs(a[1]) * (1 if label == "VI2" else 1 / 1.44)
        b[0] = np.sign(b[0]) * larger
    for k in (0, 1):
        d.constant(k, (a[k], 0.0))
        d.f[k][1][1, 0] = b[k]
    return "fold-fold", label, ""


def pseudo(d, slope):
    b1, b2, a1 = d.some(-1), d.some(1), d.some()
    d.constant(0, (a1, b1)), d.constant(1, (a1 * b2 / b1, b2))
    rest = b2 * 0 + d.f[1][1][1, 0] * a1 - b1 * d.f[1][0][1, 0] - d.f[0][1][1, 0] * a1 * b2 / b1
    d.f[0][0][1, 0] = (slope * (b2 - b1) - rest) / b2
    return b1, b2, a1


def pseudo_node(d):
    pseudo(d, d.some(-1))
    return "pseudo-equilibrium", "stable pseudo-node", ""


def pseudo_saddle(d):
    pseudo(d, d.some(1))
    return "pseudo-equilibrium", "pseudo-saddle", ""


def pseudo_saddle_node(d):
    b1, b2, a1 = pseudo(d, 0.0)
    f = d.f
    a2 = a1 * b2 / b1
    # second derivative of L2 a1 - L1 a2 along the surface, without the term of a1's u1^2
    rest = f[1][1][2, 0] * a1 + f[1][1][1, 0] * f[0][0][1, 0] - b1 * f[1][0][2, 0]
    rest -= f[0][1][2, 0] * a2 + f[0][1][1, 0] * f[1][0][1, 0]
    f[0][0][2, 0] = (d.some() - rest) / b2
    return "pseudo-equilibrium", "pseudo-saddle-node", ""


def matrix_of(d, kind):
    """A random matrix with eigenvalues of a kind, its eigenvectors in general position."""
    if kind.endswith("focus"):
        real, imaginary = 0.5 * d.some(1 if kind.startswith("un") else -1), d.some(1)
        core = np.array([[real, -imaginary], [imaginary, real]])
    else:
        low, high = d.rng.uniform(0.3, 0.8), d.rng.uniform(1.2, 2.0)
        signs = {"saddle": (-1, 1), "stable node": (-1, -1), "unstable node": (1, 1)}[kind]
        values = np.array([low, high]) * signs
        core = np.diag(values if d.rng.random() < 0.5 else values[::-1])
    t = d.rng.uniform(0, np.pi)
    # eigenvectors at an angle, away from the directions along and across the surface
    basis = np.array([[np.cos(t), np.cos(t + 1.1)], [np.sin(t), np.sin(t + 1.1)]])
    if min(abs(np.sin([t, t + 1.1]))) < 0.2:
        return matrix_of(d, kind)
    return basis @ core @ np.linalg.inv(basis)


def landing_by_flow(a):
    """L1 at which the orbit from the fold of u' = a u at u2 = -1 comes back, by the flow itself."""
    values, vectors = np.linalg.eig(a)
    start = np.array([a[1, 1] / a[1, 0], -1.0])  # u2' = a10 u1 + a11 u2 = 0
    weights = np.linalg.solve(vectors, start.astype(complex))

    def at(t):
        return (vectors @ (np.exp(values * t) * weights)).real

    half = np.pi / abs(values[0].imag)
    low, high = half, 2 * half
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if at(middle)[1] > -1 else (low, middle)
    return (a @ at(high))[1]


def boundary(d, label):
    kinds = {
        "BF1": "unstable focus", "BF2": "unstable focus", "BF3": "unstable focus",
        "BF4": "stable focus", "BF5": "stable focus", "BN1": "stable node", "BN2": "stable node",
        "UN1": "unstable node", "UN2": "unstable node",
        "BS1": "saddle", "BS2": "saddle", "BS3": "saddle",
    }  # fmt: skip
    a = matrix_of(d, kinds[label])
    positive = label in ("BF2", "BF3", "BF5", "BN2", "UN2", "BS1", "BS2")
    e2 = d.some(1)
    s = d.some(1 if positive else -1)
    if label in ("BF2", "BF3"):  # beyond iff |landing| > d/s
        ratio = -landing_by_flow(a) * (1.3 if label == "BF2" else 1 / 1.3)
        s = e2 / ratio
    if label in ("BS1", "BS2"):
        ratio = np.max(np.linalg.eigvals(a).real) * (1 / 1.3 if label == "BS1" else 1.3)
        s = e2 / ratio
    d.linear(0, a)
    d.push_by(s, e2)
    return "boundary equilibrium", label, "+"


def equilibrium(d, kind):
    """At u = (0, 0.05): real for the field above."""
    a = matrix_of(d, kind)
    for c in (0, 1):  # linear field in (u1, u2 - 0.05)
        d.f[0][c] = dict.fromkeys(POWERS, 0.0)
        d.f[0][c].update({(1, 0): a[c, 0], (0, 1): a[c, 1], (0, 0): -0.05 * a[c, 1]})
    return "equilibrium", kind, "+"


FOLD_FOLDS = ["VV1", "VV2", "VI1", "VI2", "VI3", "II1", "II2"]
BOUNDARY = [
    "BF1", "BF2", "BF3", "BF4", "BF5", "BN1", "BN2", "UN1", "UN2", "BS1", "BS2", "BS3",
]  # fmt: skip
CLASSES = {
    "crossing up": lambda d: crossing(d, 1),
    "crossing down": lambda d: crossing(d, -1),
    "attracting sliding": lambda d: sliding(d, 1),
    "repelling sliding": lambda d: sliding(d, -1),
    "visible fold": lambda d: fold(d, 1),
    "invisible fold": lambda d: fold(d, -1),
    "cusp": cusp,
    "pseudo-node": pseudo_node,
    "pseudo-saddle": pseudo_saddle,
    "pseudo-saddle-node": pseudo_saddle_node,
    **{name: lambda d, name=name: fold_fold(d, name) for name in FOLD_FOLDS},
    **{name: lambda d, name=name: boundary(d, name) for name in BOUNDARY},
}
REVERSED = {
    "crossing up": "crossing down", "crossing down": "crossing up",
    "attracting sliding": "repelling sliding", "repelling sliding": "attracting sliding",
    "stable pseudo-node": "unstable pseudo-node",
}  # fmt: skip


def build(name, seed):
    """A draw of a class, possibly mirrored and reversed in time, and what it must be called."""
    d = Draw([seed, sorted(CLASSES).index(name)])
    kind, label, side = CLASSES[name](d)
    if d.rng.random() < 0.5:
        d.swap()
        side = {"+": "-"}.get(side, side)
        if kind == "crossing":
            label = REVERSED[label]
    if d.rng.random() < 0.5:
        d.reverse()
        label = REVERSED.get(label, label)
    return d, (kind, label, side)


@pytest.mark.parametrize("count", [30, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", CLASSES)
def test_every_random_system_of_a_class_is_named(name, count):
    wrong = []
    for seed in range(count):
        d, expected = build(name, seed)
        found = d.classify()
        if (found.kind, found.label, found.side) != expected:
            wrong.append((seed, expected, str(found)))
        elif found.kind == "boundary equilibrium":
            assert found.detail.time_reversed == d.reversed
    assert not wrong, f"{len(wrong)} of {count}: {wrong[:3]}"


@pytest.mark.parametrize("count", [30, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "kind", ["stable node", "unstable node", "stable focus", "unstable focus", "saddle"]
)
def test_equilibria_off_the_surface(kind, count):
    for seed in range(count):
        d = Draw([seed, 999])
        expected = equilibrium(d, kind)
        found = d.classify(at=(0.0, 0.05))
        assert (found.kind, found.label, found.side) == expected, str(found)
        d = Draw([seed, 999])
        equilibrium(d, kind)
        d.swap()
        found = d.classify(at=(0.0, -0.05))
        assert (found.kind, found.label, found.side) == ("equilibrium", kind, "-")


# near a boundary --------------------------------------------------------------------------------


def shift_fold(d, eps):
    """L1 = eps: between crossing up and attracting sliding there is a fold."""
    fold(d, 1)
    d.f[0][1][0, 0], d.f[1][1][0, 0] = eps, d.some(1)
    return "crossing up" if eps > 0 else "attracting sliding", "visible"


def shift_cusp(d, eps):
    """L11 = eps: between visible and invisible folds there is a cusp."""
    cusp(d)
    d.f[0][1][1, 0] = eps / d.f[0][0][0, 0]
    return "visible" if eps > 0 else "invisible", "cusp"


def shift_saddle_node(d, eps):
    pseudo_saddle_node(d)
    b1, b2 = d.f[0][1][0, 0], d.f[1][1][0, 0]
    d.f[0][0][1, 0] += eps * (b2 - b1) / b2
    return "pseudo-saddle" if eps > 0 else "stable pseudo-node", "pseudo-saddle-node"


def shift_directions(d, eps):
    """VI2 and VI3 meet where a2 b1 = a1 b2."""
    fold_fold(d, "VI2")
    (f1, f2) = d.f
    f1[1][1, 0] = -abs(f1[0][0, 0] * f2[1][1, 0] / f2[0][0, 0]) * np.sign(-f1[1][1, 0]) * (1 + eps)
    return "VI2" if eps > 0 else "VI3", None


def shift_persistence(d, eps):
    boundary(d, "BF4")
    d.push_by(eps, d.f[1][1][0, 0])
    return "BF5" if eps > 0 else "BF4", None


def shift_trace(d, eps):
    """A focus turns from stable to unstable, with s < 0."""
    boundary(d, "BF4")
    f = d.f[0]
    f[0][1, 0] += eps - f[0][1, 0] - f[1][0, 1]
    if f[0][1, 0] * f[1][0, 1] - f[0][0, 1] * f[1][1, 0] < 0.1:
        return shift_trace(d, eps)
    d.push_by(-1.0, d.f[1][1][0, 0])
    return "BF1" if eps > 0 else "BF4", None


def shift_global(d, eps, pair):
    """BF2 and BF3, or BS1 and BS2, meet where d/s is a length of the linear flow."""
    boundary(d, pair[0])
    a, e2 = d.matrix(), d.f[1][1][0, 0]
    if pair[0] == "BF2":
        ratio = -landing_by_flow(a) * (1 + eps)
    else:
        ratio = np.max(np.linalg.eigvals(a).real) * (1 - eps)
    d.push_by(e2 / ratio, e2)
    return pair[0 if eps > 0 else 1], None


SHIFTS = {
    "fold": shift_fold,
    "cusp": shift_cusp,
    "pseudo-saddle-node": shift_saddle_node,
    "VI2 | VI3": shift_directions,
    "BF4 | BF5": shift_persistence,
    "BF1 | BF4": shift_trace,
    "BF2 | BF3": lambda d, eps: shift_global(d, eps, ("BF2", "BF3")),
    "BS1 | BS2": lambda d, eps: shift_global(d, eps, ("BS1", "BS2")),
}


@pytest.mark.parametrize("name", SHIFTS)
def test_near_a_boundary_nothing_is_guessed(name):
    """Far: the class. Near: degenerate, with the distance. On it: the object it is, or degenerate."""
    for seed in range(60):
        size = 10.0 ** -(1 + seed % 15)
        eps = size * (-1) ** (seed // 15)
        d = Draw([seed, 77])
        expected, on = SHIFTS[name](d, eps)
        found = d.classify()
        assert found.label in (expected, on) or found.kind == "degenerate", (eps, str(found))
        if size >= 1e-3:
            assert found.label == expected
        if found.label == on:
            assert size <= 1e-7
        if 1e-13 < size <= 1e-7 and found.kind == "degenerate":
            assert found.distance < 1e-6 and found.distance < 1e3 * size + 1e-12
        if size == 1e-7:
            assert found.kind == "degenerate"


# by the flow itself -----------------------------------------------------------------------------


def unfold(label, seed):
    """The linear boundary equilibrium with the focus or saddle a unit above the surface."""
    d = Draw([seed, 5])
    boundary(d, label)
    a = d.matrix()
    e = [d.f[1][c][0, 0] for c in (0, 1)]
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    above = [a[c, 0] * x + a[c, 1] * y for c in (0, 1)]
    system = ns.FilippovSystem([x, y], surface=y + 1, above=above, below=e)
    return system, np.array([a[1, 1] / a[1, 0], -1.0])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("label", ["BF1", "BF2", "BF3"])
def test_the_orbit_of_the_fold_returns_or_does_not(label, seed):
    """BF1, BF2: a cycle with sliding through the fold; BF3: the orbit lands beyond the saddle."""
    system, start = unfold(label, seed)
    run = ns.simulate(system, start, 5e4, start_mode="+", tol=1e-11, max_events=2)
    entry = run.events[0]
    assert entry.kind == "entry"
    if label == "BF3":
        later = run(entry.t + 10.0)
        assert abs(later[0] - start[0]) > abs(entry.x[0] - start[0])  # slides away
    else:
        assert run.events[1].kind == "exit"
        assert run.events[1].x == pytest.approx(start, abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_a_fused_focus_is_stable_as_its_number_says(seed):
    """Two flights of a bent II2 against x + (beta2 - beta1) x^2."""
    d = Draw([seed, 11])
    fold_fold(d, "II2")
    point, parameters = d.bend()
    found = classify(SYSTEM, point, parameters=parameters)
    assert found.label == "II2"
    gradient = SYSTEM.evaluate(
        SYSTEM.gradient(SYSTEM.surface_function()), point, parameters
    ).ravel()
    along = np.array([gradient[1], -gradient[0]]) / np.linalg.norm(gradient)
    a1 = SYSTEM.evaluate(SYSTEM.field("+"), point, parameters).ravel() @ along
    changes = []
    for distance in (2e-3, 1e-3):
        start = point - np.sign(a1) * distance * along
        for _ in range(3):  # onto the surface
            h = SYSTEM.evaluate(SYSTEM.surface_function(), start, parameters).item()
            start = start - h * gradient / (gradient @ gradient)
        run = ns.simulate(SYSTEM, start, 10.0, parameters=parameters, tol=1e-13, max_events=2)
        assert run.itinerary.startswith("+ -")
        back = abs((run.events[1].x - point) @ along)
        changes.append((distance - back) / distance**2)
    limit = 2 * changes[1] - changes[0]
    assert found.evidence["stability"] == pytest.approx(limit, rel=2e-2, abs=1e-2)
