"""Pictures refuse systems and results that they cannot show; legends and titles follow their options."""

import casadi as ca
import pytest

import nonsmooth as ns

x, y, z, t, lam, kap, a = (ca.SX.sym(s) for s in ("x", "y", "z", "t", "lam", "kap", "a"))


def system(n, field=None, **more):
    """A system of n states, with the surface x = 0 unless its definition is given."""
    given = {"surface": x, "above": [1] * n, "below": [1] * n} if field is None else {}
    return ns.FilippovSystem([x, y, z][:n], **given, **({"field": field} if field else {}), **more)


@pytest.mark.parametrize(
    ("draw", "n"), [(ns.plot.phase_portrait, 2), (ns.plot.sliding_portrait, 3)]
)
def test_portraits_are_of_autonomous_systems_with_one_surface(draw, n):
    two = {"surfaces": [x, y], "multipliers": [lam, kap]}
    hidden = {"surface": x, "multipliers": lam, "hidden": True}
    one, z2 = {"surface": x, "multipliers": lam}, ca.SX.sym("z2")
    rest = [1] * (n - 2)
    timed = ns.FilippovSystem(
        [x, y, z][:n], surface=x, above=[1, t, *rest], below=[1, 1, *rest], time=t
    )
    for wrong, received in (
        (1, "FilippovSystem"),
        (system(5 - n), f"{5 - n} states: x, y"),
        (system(n, [-lam, -kap, *rest], **two), "2 surfaces"),
        (timed, "explicit time"),
        (system(n, [lam**3, 1, *rest], **hidden), "hidden dynamics"),
    ):
        with pytest.raises(ns.DefinitionError, match=received):
            draw(wrong, (-1, 1, -1, 1))
    held = system(n, [lam, lam * y, *rest], discrete=[z2], **one)
    with pytest.raises(ns.DefinitionError, match="which values its discrete states"):
        draw(held, (-1, 1, -1, 1))
    r = ca.SX.sym("r")
    joined = system(n, [lam, r, *rest], constraints=ns.Constraint(y, reaction=r), **one)
    with pytest.raises(ns.DefinitionError, match="constraints: constraint"):
        draw(joined, (-1, 1, -1, 1))


def test_a_sliding_portrait_needs_the_values_of_discrete_states():
    q = ca.SX.sym("q")
    held = system(3, [lam * y, z - q, 1], surface=x, multipliers=lam, discrete={q: (0, 1)})
    with pytest.raises(ns.OptionError, match="holding"):
        ns.plot.sliding_portrait(held, (-1, 1, -1, 1))
    drawn = ns.plot.sliding_portrait(held, (-1, 1, -1, 1), holding={q: 1}, orbits=0, legend=False)
    plain = ns.plot.sliding_portrait(held.holding({q: 1}), (-1, 1, -1, 1), orbits=0, legend=False)
    texts = [[text.get_text() for text in f.axes[0].texts] for f in (drawn, plain)]
    assert texts[0] == texts[1]


def test_a_smooth_system_has_a_phase_portrait_and_no_sliding_portrait():
    with pytest.raises(ns.DefinitionError, match="0 surfaces"):
        ns.plot.sliding_portrait(system(3, [y, -x, z]), (-1, 1, -1, 1))
    focus = system(2, [y, -x - y / 2])
    axes = ns.plot.phase_portrait(focus, (-1, 1, -1, 1)).axes[0]
    marks = {line.get_gid() for line in axes.lines}
    assert "orbit" in marks and "stable focus" in marks


@pytest.mark.parametrize("orbits", [-1, 1.5, True])
def test_a_number_of_orbits_is_whole(orbits):
    system = ns.textbook.two_fold("VV-C1").system
    with pytest.raises(ns.OptionError, match="orbits"):
        ns.plot.sliding_portrait(system, (-1, 1, -1, 1), orbits=orbits)


def test_a_sliding_portrait_has_the_title_and_the_legend_that_were_requested():
    system = ns.textbook.two_fold("VV-C1").system
    figure = ns.plot.sliding_portrait(system, (-1, 1, -1, 1), orbits=0, legend=False, title="mine")
    assert figure.axes[0].get_title() == "mine"
    assert figure.axes[0].get_legend() is None


def test_branches_of_different_parameters_are_not_drawn_in_one_picture():
    b = ca.SX.sym("b")
    system = ns.FilippovSystem(
        [x, y], surface=y, above=[a + b - x, 1 - y], below=[1, 1], parameters={a: 0.0, b: 0.0}
    )
    one, two = (
        ns.continue_equilibrium(system, [0.0, 1.0], name, bounds=(-0.1, 0.1)) for name in "ab"
    )
    with pytest.raises(ns.OptionError, match=r"found.*parameter"):
        ns.plot.branch([one, two])


def test_an_equilibrium_behind_the_surface_is_drawn_as_a_virtual_one():
    """(0, a) is on its own side for a > 0 only; the pseudo-equilibrium continues where it ends."""
    system = ns.FilippovSystem(
        [x, y], surface=y, above=[-x, a - y], below=[-1 - x, 1], parameters={a: 1.0}
    )
    branch = ns.continue_equilibrium(system, [0.0, 1.0], "a", bounds=(-1, 2))
    assert branch.events[0].kind.startswith("boundary equilibrium")
    figure = ns.plot.branch(branch, legend=False, against="y")
    drawn = {line.get_gid() for line in figure.axes[0].lines}
    assert "stable equilibrium of +" in drawn
    assert figure.axes[0].get_legend() is None
    for line in figure.axes[0].lines:
        if line.get_gid() == "stable equilibrium of +":
            assert line.get_xdata().min() > -1e-9
            assert abs(line.get_ydata() - line.get_xdata()).max() < 1e-9


def test_a_plane_of_an_orbit_has_two_states():
    mu = ca.SX.sym("mu")
    system = ns.FilippovSystem([x, y], field=[y, -x + mu * (1 - x**2) * y], parameters={mu: 1.0})
    orbit = ns.periodic_orbit(system, [2.0, 0.0])
    for states in (["x"], ["x", "q"]):
        with pytest.raises(ns.OptionError, match="states"):
            ns.plot.periodic_orbit(orbit, states=states)
    assert ns.plot.periodic_orbit(orbit, legend=False).axes[0].get_legend() is None


def test_a_legend_is_left_out_on_request():
    at, b = ca.SX.sym("at"), ca.SX.sym("b")
    system = ns.FilippovSystem(
        [x, y],
        surface=y,
        above=[at + b * x - x**3, 1 - y],
        below=[1, 1],
        parameters={at: -1.0, b: 0.75},
    )
    branch = ns.continue_equilibrium(system, [-1.5, 1.0], "at", bounds=(-2, 2))
    folds = ns.continue_bifurcation(branch.events[0], ("at", "b"), bounds=[(-1, 1), (-1, 1)])
    figure = ns.plot.bifurcation_curves([folds], legend=False, title="folds")
    assert figure.axes[0].get_legend() is None
    assert figure.axes[0].get_title() == "folds"
    # 4 b^3 = 27 a^2: the semicubical parabola of a cubic's double roots
    a, slope = folds.values.T
    assert abs(4 * slope**3 - 27 * a**2).max() < 1e-9
