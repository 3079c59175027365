"""The catalogue is complete and frozen, its numbers have tolerances, and unknown names are refused."""

import dataclasses
import math

import pytest

import nonsmooth as ns
from nonsmooth import textbook
from nonsmooth.textbook.problem import stated


@pytest.mark.parametrize("name", textbook.PROBLEMS)
def test_a_problem_is_named_sourced_and_runs(name):
    problem = textbook.by_name(name)
    assert problem.name == name and problem.title and problem.source
    assert "Source:" in textbook.PROBLEMS[name].__doc__
    assert problem.references
    quantities = [r.quantity for r in problem.references]
    assert len(set(quantities)) == len(quantities)
    assert len(problem.start) == problem.system.dimension
    assert problem.parameters.keys() == set(problem.system.parameter_names)
    run = problem.run()
    assert run.status in (
        ns.Status.REACHED_END,
        ns.Status.STOPPED,
        ns.Status.ACCUMULATION,
        ns.Status.NON_UNIQUE,
        ns.Status.INTERSECTION,
    )


@pytest.mark.parametrize("name", ["harvested_prey_predator", "welander_box"])
def test_parameters_from_memory_are_marked(name):
    assert "memory" in textbook.by_name(name).note
    assert "memory" in textbook.PROBLEMS[name].__doc__


def test_problems_are_frozen():
    problem = textbook.dry_friction()
    with pytest.raises(dataclasses.FrozenInstanceError):
        problem.t_end = 1.0
    with pytest.raises(TypeError):
        problem.parameters["c"] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        problem.references[0].value = 1.0


def test_tolerance_is_nine_digits_or_the_digits_given():
    assert stated("a", "", "12.001031294830578647").tolerance == 1e-9
    assert stated("b", "", ".34105997").tolerance == pytest.approx(5e-9 / 0.34105997)
    assert stated("c", "", "-2.2").tolerance == 1e-9
    reference = stated("d", "", "2", "0")
    assert reference.error([2.002, 1e-3]) == pytest.approx(1e-3)
    assert reference.agrees([2.0, 0.0]) and not reference.agrees([2.0, math.nan])


def test_start_and_parameters_can_be_replaced_by_name():
    problem = textbook.kelvin_voigt_bounce()
    x, p = problem.start_at({"Omega": 2.0, "mu": 0.1})
    assert x.tolist() == [0.0, 1.0, 0.0, -1.0, 2.0] and p["mu"] == 0.1
    with pytest.raises(ns.ParameterError, match="nosuch"):
        problem.run({"nosuch": 1.0})


def test_unknown_names_are_refused_with_the_list():
    with pytest.raises(ns.OptionError, match="'nosuch'"):
        textbook.by_name("nosuch")
    with pytest.raises(KeyError, match="first impact"):
        textbook.bouncing_ball()["second impact"]
    with pytest.raises(ns.OptionError, match="first impact"):
        textbook.bouncing_ball()["first impact"].error([1.0, 2.0])


@pytest.mark.parametrize("label", textbook.TWO_FOLDS)
def test_two_fold_labels_build_their_own_class(label):
    """The conditions of the decision table, by the eigenvalues and slopes of the sliding flow."""
    problem = textbook.two_fold(label)
    run = problem.run(tol=1e-12)
    assert run.segments[0].mode == "s"  # the start is in attracting sliding
    (s1, s2), (n1, n2) = textbook.TWO_FOLDS[label]
    trace, determinant, disc = (problem[q].value for q in ("trace", "determinant", "discriminant"))
    gap = s1 * (n2 - n1)
    expected = {
        "VV-C1": (s1, s2) == (1, -1) and not (n1 > 0 and n2 > 0 and n1 * n2 >= 1),
        "VV-F": (s1, s2) == (1, -1) and n1 > 0 and n2 > 0 and n1 * n2 > 1,
        "II-C": (s1, s2) == (-1, 1) and n1 < 0 and n2 < 0 and n1 * n2 > 1,
        "II-F": (s1, s2) == (-1, 1) and not (n1 < 0 and n2 < 0 and n1 * n2 >= 1),
        "mix-0": s1 == s2 and gap < 2 and disc < 0,
        "mix-S": s1 == s2 and gap > 2 and determinant < 0,
        "mix-C": s1 == s2 and gap >= 2 and determinant > 0 and trace < 0,
        "mix-F": s1 == s2 and gap >= 2 and determinant > 0 and trace > 0,
    }
    assert [name for name, holds in expected.items() if holds] == [label]


def test_two_fold_from_numbers():
    assert textbook.two_fold((1, 1), (2, -2)).parameters == {"nu1": 2.0, "nu2": -2.0}
    assert textbook.two_fold(sigma=(1, 1), nu=(2, -2)).parameters == {"nu1": 2.0, "nu2": -2.0}
    for arguments, message in [
        (("VV-X",), "label"),
        (("II-C", (1, 2)), r"\bnu\b"),
        (((1, 0), (1, 2)), "sigma"),
        (((1, 1), None), r"\bnu\b"),
        (((1, 1), (1, math.nan)), r"\bnu\b"),
    ]:
        with pytest.raises(ns.OptionError, match=message):
            textbook.two_fold(*arguments)
