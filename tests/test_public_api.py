"""The top level has the functions, classes and errors that most programs use; each name has one place."""

import inspect
import types

import pytest

import nonsmooth as ns

TWO_FOLDS = set(
    """
    Boundary Classification NormalForm ReducedFlow Slopes accumulation_time classify_two_fold
    diabolo_slopes flight_above flight_below max_flights normal_form return_matrix
""".split()
)
RESULTS = set(
    """
    BoundaryBifurcation BoundaryEquilibrium Continuation Equilibrium Fold FoldFold Intersection
    LocalObject PseudoEquilibrium SlidingBranch
""".split()
)
ORBITS = set(
    """
    Basins BifurcationCurve Branch BranchEvent CodimensionTwo Connection FarSide Funnel Gradient
    LyapunovSpectrum Manifold PoincareOrbit
""".split()
)


def test_dir_is_the_public_api_and_nothing_else():
    assert dir(ns) == sorted([*ns.__all__, "__version__"])
    assert list(ns.__all__) == sorted(ns.__all__)
    assert all(getattr(ns, name) is not None for name in ns.__all__)


def test_modules_at_the_top_are_those_of_its_docstring():
    modules = {n for n in ns.__all__ if isinstance(getattr(ns, n), types.ModuleType)}
    assert modules == {
        *("continuation", "flow", "interop", "local", "orbit"),
        *("plot", "proofs", "textbook", "two_folds"),
    }
    for name in modules:
        assert name in inspect.getdoc(ns)


@pytest.mark.parametrize(
    ("door", "names"), [("two_folds", TWO_FOLDS), ("local", RESULTS), ("orbit", ORBITS)]
)
def test_each_name_is_exported_once(door, names):
    module = getattr(ns, door)
    assert names <= set(module.__all__)
    for name in names:
        assert inspect.getdoc(getattr(module, name))
        assert name not in ns.__all__
        with pytest.raises(AttributeError, match=name):
            getattr(ns, name)


def test_the_algebra_of_two_folds_needs_no_system():
    assert set(ns.two_folds.__all__) == TWO_FOLDS
    for name in TWO_FOLDS:
        thing = getattr(ns.two_folds, name)
        if inspect.isfunction(thing):
            assert "system" not in inspect.signature(thing).parameters


@pytest.mark.parametrize(
    ("name", "said"),
    [("poincare", "ns.orbit.poincare"), ("Event", "ns.flow.Event"), ("nothing", "no attribute")],
)
def test_a_name_that_is_not_at_the_top_is_answered_with_its_place(name, said):
    with pytest.raises(AttributeError, match=said):
        getattr(ns, name)
