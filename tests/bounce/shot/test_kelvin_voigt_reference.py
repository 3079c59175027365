"""Linear bounces agree with 40-digit references: 1e-10 at tol = 1e-13, 100 tol from 1e-6 down."""

import json
from pathlib import Path

import numpy as np
import pytest

import bounce

DATA = Path(__file__).parents[2] / "data"
CASES = json.loads((DATA / "kelvin_voigt_bounce.json").read_text(encoding="utf-8"))["cases"]
FIGURE = json.loads((DATA / "kv_pert_figure.json").read_text(encoding="utf-8"))["sets"]
LETTERS = {"S+": "+", "S-": "-", "R": "s", "F": "F"}
RUNS = [
    pytest.param(case, load, case[key], id=f"{case['id']}-{load}")
    for case in CASES
    for load, key in (("net", "outputs"), ("contact", "outputs_physical_contact"))
    if key in case
]


def simulated(parameters, start, load, tol):
    x, xdot, y, ydot, omega = map(float, start)
    values = {name: float(value) for name, value in parameters.items()}
    return bounce.simulate(
        bounce.KelvinVoigt(**values, load=load), xdot, ydot, omega, x, y, tol=tol
    )


def check(shot, expected, bound):
    assert shot.itinerary == " ".join(LETTERS[m] for m in expected["itinerary"].split())
    end = np.array(expected["p_F"], dtype=float)
    assert np.abs(shot.trajectory.x[-1] - end).max() <= bound
    assert abs(shot.time - float(expected["tau_F"])) <= bound
    assert abs(shot.slip - float(expected["H_F"])) <= bound
    times = [float(t["tau"]) for t in expected["transitions"]]
    assert np.abs([0.0, *(p.t_end for p in shot.phases)] - np.array(times)).max() <= bound


@pytest.mark.parametrize("tol", [1e-13, 1e-10, 1e-8, 1e-6])
@pytest.mark.parametrize(("case", "load", "expected"), RUNS)
def test_reference(case, load, expected, tol):
    bound = 1e-10 if tol == 1e-13 else 100 * tol
    check(simulated(case["params"], case["p0"], load, tol), expected, bound)


@pytest.mark.parametrize(
    ("case", "load", "expected"), [r for r in RUNS if r.values[2]["transitions"][0].get("p")]
)
def test_states_at_transitions(case, load, expected):
    shot = simulated(case["params"], case["p0"], load, 1e-13)
    for transition in expected["transitions"]:
        state = shot(min(float(transition["tau"]), shot.time))
        assert np.abs(state - np.array(transition["p"], dtype=float)).max() <= 1e-10


@pytest.mark.parametrize(
    ("case", "load", "expected"), [r for r in RUNS if r.values[2].get("rolls")]
)
def test_forces_while_rolling(case, load, expected):
    shot = simulated(case["params"], case["p0"], load, 1e-13)
    for roll in expected["rolls"]:
        for sample in roll["samples"][1:-1]:
            forces = shot.forces(float(sample["tau"]))
            assert abs(forces.load - float(sample["Lambda_N"])) <= 1e-10
            assert abs(forces.friction - float(sample["Lambda_T"])) <= 1e-10


@pytest.mark.parametrize("name", ["A_printed", "A_exact", "B", "C"])
@pytest.mark.parametrize("figure", FIGURE, ids=[s["id"] for s in FIGURE])
def test_starts_in_mid_contact(figure, name):
    """The paper's figure starts late in restitution; trajectory A lifts off rolling."""
    expected = figure["trajectories"][name]
    shot = simulated(figure["params"], expected["p0"], "net", 1e-13)
    check(shot, expected, 1e-12)
