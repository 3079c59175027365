"""Arguments are read strictly, and every refusal is a NonsmoothError that names the argument."""

import subprocess
import sys

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

X, Y, P, T, LAM = (ca.SX.sym(name) for name in ("x", "y", "p", "t", "lam"))


def relay(**options):
    return ns.FilippovSystem(
        [X, Y], surface=Y, above=[Y, -X - P], below=[Y, -X + P], parameters={P: 0.4}, **options
    )


SYSTEM = relay()
TWO = ns.FilippovSystem(
    [X, Y, T], field=[-LAM, -P, 1 + LAM * P], multipliers=[LAM, P], surfaces=[X, Y]
)


@pytest.mark.parametrize(
    "value", [1, 1.0, np.int64(1), np.float32(1), np.array(1.0), ca.DM(1.0)], ids=repr
)
def test_every_kind_of_real_number_is_a_time(value):
    assert ns.simulate(SYSTEM, [3, 0], value).t[-1] == 1.0


@pytest.mark.parametrize("value", [True, "1", 1j, None, np.array([1.0]), np.nan, np.inf], ids=repr)
@pytest.mark.parametrize("name", ["t_end", "t_start", "tol", "rtol", "atol"])
def test_what_is_no_real_number_is_no_time_and_no_tolerance(name, value):
    if value is None and name in ("rtol", "atol"):
        return  # the default
    options = {"t_end": 1.0, name: value}
    with pytest.raises(ns.OptionError, match=r"tol|t_end|t_start"):
        ns.simulate(SYSTEM, [3.0, 0.0], **options)


@pytest.mark.parametrize("name", ["max_steps", "max_events", "max_jumps"])
@pytest.mark.parametrize("value", [0, -1, 1.5, True, np.inf, "3", None], ids=repr)
def test_limits_are_positive_whole_numbers(name, value):
    with pytest.raises(ns.OptionError, match=name):
        ns.simulate(SYSTEM, [3.0, 0.0], 1.0, **{name: value})


@pytest.mark.parametrize(
    "start",
    [
        ["1", "2"],
        [True, False],
        [1 + 0j, 2],
        [None, 2],
        [X, Y],
        "12",
        {"x": 1},
        [[1], [2, 3]],
        np.ma.array([1.0, 2.0], mask=[False, True]),
    ],
    ids=repr,
)
def test_a_start_is_real_numbers(start):
    with pytest.raises(ns.PointError, match="point"):
        ns.simulate(SYSTEM, start, 1.0)


@pytest.mark.parametrize(
    "start", [(3, 0), np.array([3, 0]), ca.DM([3, 0]), np.array([3, 0], object)]
)
def test_any_sequence_of_real_numbers_is_a_start(start):
    run = ns.simulate(SYSTEM, start, 1.0)
    np.testing.assert_array_equal(run.x, ns.simulate(SYSTEM, [3.0, 0.0], 1.0).x)


@pytest.mark.parametrize("parameters", [[0.1], 0.1, "p", np.array([0.1])], ids=repr)
def test_parameters_are_a_mapping(parameters):
    with pytest.raises(ns.ParameterError, match=r"parameters.*'p'"):
        ns.simulate(SYSTEM, [3.0, 0.0], 1.0, parameters=parameters)


@pytest.mark.parametrize("value", [True, "0.4", 1j, [0.4], np.array([0.4]), np.nan], ids=repr)
def test_a_parameter_is_one_finite_number(value):
    with pytest.raises(ns.ParameterError, match="parameter 'p'"):
        ns.simulate(SYSTEM, [3.0, 0.0], 1.0, parameters={"p": value})


def test_a_parameter_given_twice_is_refused():
    with pytest.raises(ns.ParameterError, match=r"parameters.*'p'"):
        ns.simulate(SYSTEM, [3.0, 0.0], 1.0, parameters={"p": 1, P: 2})


@pytest.mark.parametrize(
    "call",
    [
        lambda s: ns.simulate(s, [0, 0], 1.0),
        lambda s: ns.flow.follow(s, [0, 0], 1.0, mode="+"),
        lambda s: ns.orbit.funnel(s, [0, 0], 1.0),
        lambda s: ns.region(s, [0, 0]),
        lambda s: ns.classify(s, [0, 0]),
        lambda s: ns.find_two_fold(s, [0, 0]),
        lambda s: ns.regularise(s),
        lambda s: ns.local.intersection_range(s, [0, 0], X),
    ],
)
@pytest.mark.parametrize("system", [None, "system", [X, Y]], ids=repr)
def test_a_system_is_requested_where_there_is_none(call, system):
    with pytest.raises(ns.DefinitionError, match="system"):
        call(system)


@pytest.mark.parametrize("time", ["a", 0.5 + 1j, [True]], ids=repr)
def test_dense_output_takes_real_times(time):
    with pytest.raises(ns.PointError, match="time"):
        ns.simulate(SYSTEM, [3.0, 0.0], 1.0)(time)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stops": [X]}, "stops"),
        ({"stops": 3}, "stops"),
        ({"resets": [ns.Stop(X)]}, "resets"),
        ({"stops": [ns.Stop(1)]}, "stop 'stop'.*constant"),
        ({"stops": [ns.Stop(P - 1)]}, "stop 'stop'"),
        ({"stops": [ns.Stop(X, direction=True)]}, "direction of 'stop'"),
    ],
)
def test_stops_and_resets_are_what_they_are_called(options, message):
    with pytest.raises(ns.DefinitionError, match=message):
        relay(**options)


def test_one_stop_needs_no_list():
    assert relay(stops=ns.Stop(X)).stops == (("stop", 0),)


def test_a_surface_may_be_of_the_time_alone():
    def square(surface, states, field, **options):
        return ns.FilippovSystem(states, field=field, multipliers=LAM, surface=surface, **options)

    wave = square(ca.sin(T), [X], [LAM], time=T)
    end = ns.simulate(wave, [0.0], 6.0).x[-1, 0]
    assert end == pytest.approx(2.0 * np.pi - 6.0, abs=1e-9)
    wave = square(ca.sin(Y), [X, Y], [LAM, 1])
    end = ns.simulate(wave, [0.0, 0.5], 6.0).x[-1, 0]
    assert end == pytest.approx(6.0 - 2.0 * np.pi, abs=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ns.local.intersection_range(TWO, [0, 0, 0], "x"), r"\bof\b.*CasADi"),
        (lambda: ns.local.intersection_range(TWO, [0, 0, 0], X, surfaces=[5]), "surface"),
        (lambda: ns.local.intersection_range(TWO, [0, 0, 0], X, surfaces=[0, 0]), "surfaces"),
        (lambda: ns.local.intersection_range(TWO, [0, 1, 0], X), "point.*h1 = 1"),
        (lambda: SYSTEM.evaluate("a", [0, 0]), "expression"),
        (lambda: SYSTEM.surface_function("a"), "surface"),
        (lambda: ns.regularise(SYSTEM, True), r"\beps\b"),
        (lambda: ns.regularise(SYSTEM, name=3), "name"),
        (lambda: ns.regularise(SYSTEM, transition=lambda s: "a"), "transition"),
        (lambda: ns.flow.follow(SYSTEM, [0, 0], None, mode="+"), "t_end"),
        (lambda: ns.find_all(None, [[0, 0]]), "search"),
        (lambda: ns.find_all(lambda x: x, "ab"), "starts"),
        (lambda: ns.two_folds.return_matrix(None), r"\bnu\b"),
        (lambda: ns.two_folds.return_matrix((1,)), r"\bnu\b"),
        (lambda: ns.two_folds.accumulation_time("ab"), r"\bnu\b"),
        (lambda: ns.two_folds.max_flights((-1, 1), (np.nan, 1)), r"\bnu\b"),
        (lambda: ns.two_folds.max_flights((1, 2), (1, 1)), "sigma"),
        (lambda: ns.two_folds.flight_above("a", (1, 1)), r"\bz\b"),
        (lambda: ns.two_folds.flight_below([1, 2, 3], (1, 1)), r"\bz\b"),
        (lambda: ns.two_folds.normal_form(None), r"\blie\b"),
        (lambda: ns.two_folds.normal_form({"L11": 1.0}), r"\blie\b"),
        (lambda: ns.flow.first_root([], 1.0), "coefficients"),
        (lambda: ns.flow.first_root("ab", 1.0), "coefficients"),
        (lambda: ns.textbook.two_fold(None), "sigma"),
        (lambda: ns.plot.trajectory(ns.simulate(SYSTEM, [3, 0], 1), samples="a"), "samples"),
    ],
)
def test_other_wrong_arguments(call, message):
    with pytest.raises(ns.NonsmoothError, match=message):
        call()


def test_a_first_run_loads_no_masked_arrays():
    """NumPy loads them on demand, which takes a third of the time of a first run."""
    code = (
        "import sys, casadi as ca, numpy, nonsmooth as ns\n"
        "before = 'numpy.ma' in sys.modules\n"
        "x = ca.SX.sym('x')\n"
        "ns.simulate(ns.FilippovSystem([x], field=[-x]), [1], 1.0)\n"
        "print(before, 'numpy.ma' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    before, after = done.stdout.split()
    assert after == before
