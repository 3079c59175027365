"""A contact model is two forces written once: immutable, checked, and refused with a clear message."""

import inspect
import math
import pickle

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns

TURF = dict(mu=0.3, d1=0.1, d2=0.1, eta=0.5)


class Spring(bounce.ContactModel):
    parameters = dict(mu=0.3, k=4.0)
    limits = dict(k="> 0")

    def normal_force(self, s, p):
        return -p.k * s.y

    def tangential_force(self, s, p):
        return 0


class Mud(bounce.ContactModel):
    parameters = dict(mu=0.4, k=1.0, c=0.3, eta=0.5)

    def normal_force(self, s, p):
        depth = -s.y
        return p.k * depth * ca.sqrt(depth + 1e-9) - p.c * depth * s.ydot

    def tangential_force(self, s, p):
        return -(p.eta**2) * s.x - 0.2 * p.eta * s.xdot


def test_a_model_of_ones_own():
    shot = bounce.simulate(Mud(), xdot=1.0, ydot=-1.0, omega=0.2)
    assert shot.itinerary == "+ s -"
    end = shot.lift_off
    assert end.y < 0 < end.ydot, "the damper ends the contact in the ground"
    assert -end.y * math.sqrt(1e-9 - end.y) + 0.3 * end.y * end.ydot == pytest.approx(0, abs=1e-12)


K = np.linspace(-3.0, 3.0, 13)
TABLE = ca.interpolant("my_table", "linear", [K], K)
U = ca.SX.sym("u")
SAME = ca.Function("same", [U], [2 * U / 2], {"never_inline": True})


def spring_of(method, function):
    """A spring one of whose methods goes through a Function of CasADi."""

    class Law(bounce.contact.Coulomb):
        def traction(self, s, p, sign):
            given = -sign * self.coefficient(s, p)
            return function(given) if method == "traction" else given

    class Named(Spring):
        def normal_force(self, s, p):
            return -p.k * s.y

        def stored_energy(self, s, p):
            return p.k * s.y**2 / 2

        def tangential_force(self, s, p):
            return -0.2 * s.x

        extra_states = {"heat": 0.0}

        def extra_rates(self, s, p):
            return {"heat": s.slip}

    def through(self, s, p):
        given = original(self, s, p)
        return {"heat": function(given["heat"])} if method == "rate of heat" else function(given)

    if method != "traction":
        name = "extra_rates" if method == "rate of heat" else method
        original = getattr(Named, name)
        setattr(Named, name, through)
    return Named(friction=Law() if method == "traction" else None)


METHODS = [
    *("normal_force", "tangential_force", "load", "lift_off", "friction_coefficient"),
    *("traction", "rate of heat", "stored_energy"),
]
LANDINGS = {"plane": (1.0, -1.0, 0.2), "space": ([1.0, 0.3], -1.0, [0.2, 0.1])}


@pytest.mark.parametrize("landing", LANDINGS)
@pytest.mark.parametrize("method", METHODS)
def test_a_table_in_a_model_is_refused_by_name(method, landing):
    with pytest.raises(bounce.ModelError, match=rf"{method}.*: .*'my_table'"):
        bounce.simulate(spring_of(method, TABLE), *LANDINGS[landing])


@pytest.mark.parametrize(
    ("method", "landing"),  # a traction of one's own that takes a sign is for the plane
    [(m, where) for m in METHODS for where in LANDINGS if (m, where) != ("traction", "space")],
)
def test_a_function_of_casadi_in_a_model_is_the_same_as_written_out(method, landing):
    ends = []
    for function in (SAME, lambda u: u):
        end = bounce.simulate(spring_of(method, function), *LANDINGS[landing]).lift_off
        ends.append(np.hstack([end.x, end.xdot, end.y, end.ydot, end.omega]))
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-12)


def test_value_semantics():
    turf = bounce.KelvinVoigt(**TURF, G=1e-4)
    assert turf == bounce.KelvinVoigt(**TURF, G=1e-4)
    assert turf != turf.replace(mu=0.4)
    assert turf != turf.replace(load="net")
    assert turf != turf.replace(friction=bounce.contact.Viscous(viscosity=0.1))
    assert len({turf, turf.replace(), turf.replace(mu=0.4)}) == 2
    assert turf.replace(mu=0.4).values["mu"] == 0.4
    assert turf.replace(load="net").replace(load="contact") == turf
    assert Spring() != Mud()


def test_pickle_with_a_built_system():
    turf = bounce.KelvinVoigt(**TURF, friction=bounce.contact.Viscous(viscosity=0.1))
    turf.system()
    copy = pickle.loads(pickle.dumps(turf))
    assert copy == turf and hash(copy) == hash(turf) and repr(copy) == repr(turf)
    shot = bounce.simulate(turf, 0.3, -1.0, 0.1)
    again = pickle.loads(pickle.dumps(shot))
    assert again.lift_off == shot.lift_off and again.itinerary == shot.itinerary


def test_signature_names_the_parameters():
    names = list(inspect.signature(bounce.KelvinVoigt).parameters)
    assert names == ["load", "friction", "mu", "d1", "d2", "eta", "G", "inertia", "slope"]


def test_system_has_the_models_values_and_blueprints_are_shared():
    turf = bounce.KelvinVoigt(**TURF, G=1e-4)
    system = turf.system()
    assert system is turf.system()
    assert system.state_names == ("x", "xdot", "y", "ydot", "omega")
    run = ns.simulate(system, [0.0, 0.3, 0.0, -1.0, 0.1], 100.0)
    assert run.status is ns.Status.STOPPED
    shot = bounce.simulate(turf, 0.3, -1.0, 0.1)
    assert np.array_equal(run.x[-1], shot.trajectory.x[-1])
    assert turf.blueprint() == turf.replace(mu=0.4).blueprint()
    other = bounce.simulate(turf.replace(mu=0.4), 0.3, -1.0, 0.1)
    assert other.trajectory.system is shot.trajectory.system


def test_gravity_of_the_net_convention_can_be_set_on_the_system():
    """Without gravity both conventions share one system, but not the one that is handed out."""
    system = bounce.KelvinVoigt(**TURF, load="net").system()
    run = ns.simulate(system, [0.0, 0.3, 0.0, -1.0, 0.1], 100.0, parameters={"G": 0.05})
    shot = bounce.simulate(bounce.KelvinVoigt(**TURF, G=0.05, load="net"), 0.3, -1.0, 0.1)
    assert np.abs(run.x[-1] - shot.trajectory.x[-1]).max() < 1e-12


@pytest.mark.parametrize("inertia", [2 / 5, 2 / 3, 0.5])
def test_rolling_field_is_smooth_for_any_inertia(inertia):
    """x'' = A/(1 + inertia) while rolling, through the end of the load."""
    turf = bounce.KelvinVoigt(**TURF, inertia=inertia)
    start = [0.1, 0.2, -0.4, 0.3, -0.2]
    run = ns.simulate(turf.system(), start, 1e-3, start_mode="s")
    a = -(2 * 0.1 * 0.5 * 0.2 + 0.25 * 0.1)
    slope = (run(1e-3)[1] - 0.2) / 1e-3
    assert slope == pytest.approx(a / (1 + inertia), rel=1e-2)


def test_slope_tilts_gravity():
    flat = bounce.NormalKelvinVoigt(mu=0.3, d2=0.1, G=0.1)
    tilted = flat.replace(slope=0.2)
    a = bounce.simulate(flat, 0.0, -1.0, 5.0, tol=1e-12)
    b = bounce.simulate(tilted, 0.0, -1.0, 5.0, tol=1e-12)
    assert b.lift_off.xdot < a.lift_off.xdot  # uphill for positive x
    level = bounce.simulate(flat.replace(G=0.1 * np.cos(0.2)), 0.0, -1.0, 5.0, tol=1e-12)
    assert b.lift_off.ydot == pytest.approx(level.lift_off.ydot, abs=1e-11)


def test_maxwell_element_is_an_extra_state():
    """A fast branch is a damper, a slow one a spring: both limits are linear models."""
    damper = bounce.contact.Maxwell(mu=0.3, branch_stiffness=1e3, relaxation=2e-4)
    fast = bounce.simulate(damper, 1.0, -1.0, 0.5)
    assert fast.trajectory.system.state_names[-1] == "branch"
    kv = bounce.simulate(bounce.NormalKelvinVoigt(mu=0.3, d2=0.1), 1.0, -1.0, 0.5)
    assert abs(fast.lift_off.ydot - kv.lift_off.ydot) < 2e-3
    slow = bounce.simulate(
        bounce.contact.Maxwell(mu=0.3, branch_stiffness=3.0, relaxation=1e8), 1, -1, 0.5
    )
    assert slow.time == pytest.approx(np.pi / 2, abs=1e-7)


class NoReturn(Spring):
    def normal_force(self, s, p):
        p.k * s.y


class Misspelt(Spring):
    def normal_force(self, s, p):
        return -p.stiffness * s.y


class NotSmooth(Spring):
    def normal_force(self, s, p):
        return ca.fmax(0, -p.k * s.y)


class NoRate(Spring):
    extra_states = dict(z=0.0)


class Clash(Spring):
    extra_states = dict(mu=0.0)


class Twice(Spring):
    extra_states = dict(omega=0.0)


class NotFinite(Spring):
    def normal_force(self, s, p):
        return -ca.log(-s.y)


@pytest.mark.parametrize(
    ("model", "error", "message"),
    [
        (NoReturn, bounce.ModelError, "normal_force"),
        (Misspelt, bounce.UnknownNameError, "'stiffness'.*'k'"),
        (NotSmooth, ns.NotSmoothError, "fmax"),
        (NoRate, bounce.ModelError, "extra_rates"),
        (Clash, bounce.ModelError, "'mu'"),
        (Twice, bounce.ModelError, "extra_states"),
        (NotFinite, bounce.LandingError, "load"),
    ],
)
def test_a_broken_model_is_refused(model, error, message):
    with pytest.raises(error, match=message):
        bounce.simulate(model(), 1.0, -1.0, 0.0)


def test_both_forces_are_obligatory():
    class OnlyNormal(bounce.ContactModel):
        parameters = dict(mu=0.3)

        def normal_force(self, s, p):
            return -s.y

    with pytest.raises(TypeError, match="tangential_force"):
        OnlyNormal()


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        (dict(TURF, mu=-0.3), ns.ParameterError, "mu"),
        (dict(TURF, mu=float("nan")), ns.ParameterError, "mu"),
        (dict(TURF, eta=float("inf")), ns.ParameterError, "eta"),
        (dict(TURF, mu="rough"), ns.ParameterError, "mu"),
        (dict(TURF, mu=True), ns.ParameterError, "mu"),
        (dict(TURF, d2=-0.1), ns.ParameterError, "d2"),
        (dict(TURF, G=-1.0), ns.ParameterError, "G"),
        (dict(TURF, inertia=1.5), ns.ParameterError, "inertia"),
        (dict(TURF, slope=2.0), ns.ParameterError, "slope"),
        (dict(TURF, nu=1.0), ns.ParameterError, "'nu'"),
        (dict(mu=0.3), ns.ParameterError, "d1.*d2.*eta"),
        (dict(TURF, load="gross"), bounce.ModelError, "load"),
        (dict(TURF, friction=0.3), bounce.ModelError, "friction"),
        (
            dict(TURF, friction=bounce.contact.Viscous(viscosity=0.1), viscosity=-1.0),
            ns.ParameterError,
            "viscosity",
        ),
    ],
)  # fmt: skip
def test_impossible_parameters(values, error, message):
    with pytest.raises(error, match=message):
        bounce.KelvinVoigt(**values)


def test_models_are_immutable():
    turf = bounce.KelvinVoigt(**TURF)
    with pytest.raises(AttributeError, match=r"use model.replace\(mu=...\)"):
        turf.mu = 0.4
    with pytest.raises(AttributeError, match="immutable"):
        del turf.values


def own(**attributes):
    forces = dict(
        normal_force=lambda self, s, p: -s.y, tangential_force=lambda self, s, p: -0.1 * s.x
    )
    return type("Own", (bounce.ContactModel,), dict(parameters=dict(mu=0.3)) | forces | attributes)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        (dict(normal_force=lambda self, s, p: 1.0), "load"),
        (dict(normal_force=lambda self, s, p: -math.sin(s.y)), "normal_force"),
        (dict(extra_states=dict(z="a")), "z"),
        (dict(extra_states=dict(z=math.nan)), "z"),
        (dict(extra_states=dict(z=0.0), extra_rates=lambda self, s, p: [-s.z]), "extra_rates"),
    ],
)
def test_a_model_that_cannot_be_built(attributes, message):
    with pytest.raises(bounce.ModelError, match=message):
        own(**attributes)().system()


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        (dict(limits=dict(mu="positive")), "mu"),
        (dict(parameters=["mu"]), "parameters"),
        (dict(parameters=dict(mu=0.3, load=1.0)), "options, received ..load.."),
    ],
)
def test_wrong_declarations(attributes, message):
    with pytest.raises(bounce.ModelError, match=message):
        own(**attributes)


def test_a_negative_stiffness_is_physically_impossible():
    with pytest.raises(ns.ParameterError, match="stiffness"):
        bounce.Hertz(mu=0.3, stiffness=-1.0)
