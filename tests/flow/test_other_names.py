"""Arguments and attributes under the names of other tools are refused with a hint."""

import copy
import pickle

import casadi as ca
import pytest

import nonsmooth as ns


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"t_span": (0, 1)}, "t_start= and t_end="),
        ({"y0": [1.0], "t_end": 1.0}, "x0="),
        ({"x0": [1.0], "t_end": 1.0, "events": []}, "stops="),
        ({"x0": [1.0], "t_end": 1.0, "args": (1,)}, "parameters="),
        ({"x0": (0, 1), "t_end": [1.0]}, r"system, x0, t_end"),
        ({"x0": [1.0], "t_end": (0, 1)}, r"a span is t_start= and t_end="),
    ],
)
@pytest.mark.parametrize("verb", [ns.simulate, ns.ensemble])
def test_arguments_of_scipy_have_a_hint(verb, given, words):
    x = ca.SX.sym("x")
    with pytest.raises(ns.OptionError, match=words):
        verb(ns.FilippovSystem([x], field=[-x]), **given)


def test_attributes_of_scipy_have_a_hint():
    x = ca.SX.sym("x")
    run = ns.simulate(ns.FilippovSystem([x], field=[-x]), [1.0], 1.0)
    for name, words in {"y": "x, of shape", "sol": r"run\(t\)", "t_events": "events"}.items():
        with pytest.raises(AttributeError, match=f"no attribute '{name}'. It has {words}"):
            getattr(run, name)
    with pytest.raises(AttributeError, match=r"no attribute 'steps_taken'$"):
        getattr(run, "steps" + "_taken")
    assert copy.deepcopy(run).status is pickle.loads(pickle.dumps(run)).status is run.status
