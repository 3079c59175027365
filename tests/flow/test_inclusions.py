"""The law of elements against cases whose truth was found without the library."""

import warnings

import numpy as np
import pytest

import nonsmooth as ns

from .inclusions import MISSING, Case, accelerations, cases

#: Elements of relative degree two and roots.
LATER = ("rest", "twisting", "super-twisting", "tank")

EVERY = [own for own in cases() if not any(key in own for key in MISSING)]
NOW = [own for own in EVERY if not own["id"].startswith(LATER)]

#: Tests that do not pass yet, and why.
OPEN = {
    "test_a_case_is_as_known[layer-two-surfaces]": "the law of elements is being built",
    "test_a_case_is_as_known[layer-ring-three]": "the law of elements is being built",
    "test_a_case_is_as_known[layer-units-1.9]": "the law of elements is being built",
    "test_a_case_is_as_known[layer-units-2.1]": "the law of elements is being built",
    "test_a_case_is_as_known[parallel-1e-10]": "the law of elements is being built",
    "test_a_case_is_as_known[body-two-contacts-several-1]": "the law of elements is being built",
}


@pytest.mark.parametrize("data", NOW, ids=lambda own: own["id"])
def test_a_case_is_as_known(data):
    check(Case(data))


def check(case: Case) -> None:
    data, truth = case.data, case.data["truth"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = case.run()
    if "t_lost" in truth:
        assert run.status is ns.Status.INTERSECTION, run.message
        lost = run.events[-2] if len(run.events) > 1 else None
        assert lost is not None and lost.kind == "stability"
        assert run.t[-1] == pytest.approx(float(truth["t_lost"]), abs=1e-8)
    elif "k_limit" in truth:
        assert run.facts.depends_on_widths
        stable = float(truth["trace"]) > 0
        assert run.status is (ns.Status.REACHED_END if stable else ns.Status.INTERSECTION)
    elif "accelerations" in truth:
        want = np.array(truth["accelerations"], float)
        found = accelerations(run)
        assert (run.status is ns.Status.NON_UNIQUE) == (len(want) > 1), run.message
        assert found.shape == want.shape, run.message
        assert abs(found - want[np.lexsort(want.T[::-1].round(7))]).max() < 1e-9
    elif data.get("expect") == "NON_UNIQUE":
        assert run.status is ns.Status.NON_UNIQUE, run.message
    else:
        assert run.status is ns.Status.REACHED_END, run.message
        errors = case.errors(run)
        assert errors, "nothing is compared"
        assert max(errors.values()) < 1e-8, errors
    if set(data.get("itinerary", "x")) <= set("+-s "):
        assert run.itinerary == data["itinerary"]
