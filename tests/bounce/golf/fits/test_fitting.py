"""A fit finds the parameters behind synthetic bounces, with intervals that cover them as they say."""

import json
import math
import warnings

import numpy as np
import pytest

import bounce
import nonsmooth as ns

TRUE = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.15, eta=0.5)
GUESS = TRUE.replace(mu=0.5, eta=0.8, d2=0.3)


def synthetic(model, n, noise=0.0, seed=0, components=("xdot", "ydot", "omega")):
    rng = np.random.default_rng(seed)
    u, w = rng.uniform(-1, 1, n), rng.uniform(-1.5, 1.5, n)
    off = (
        model.lift_off(u, -1.0, w)
        if isinstance(model, bounce.laws.BounceLaw)
        else bounce.lift_off(model, u, -1.0, w)
    )
    data = dict(xdot=u, ydot=-np.ones(n), omega=w)
    for c in components:
        data[f"lift_off_{c}"] = getattr(off, c) + noise * rng.normal(size=n)
    return data


@pytest.mark.slow
def test_exact_data_give_the_exact_parameters():
    found = bounce.golf.fit(GUESS, synthetic(TRUE, 15), parameters=["mu", "eta", "d2"], starts=4)
    for name in ("mu", "eta", "d2"):
        assert found.values[name] == pytest.approx(TRUE.values[name], rel=1e-7)
    assert found.model.values["d1"] == TRUE.values["d1"]
    assert max(found.rms.values()) < 1e-8 and not found.at_bound


def test_gradient_is_that_of_differences():
    data = bounce.golf.read_measurements(synthetic(TRUE, 12))
    from bounce.golf.fits.least_squares import Problem

    problem = Problem(
        GUESS, data, ["mu", "eta", "d2"], None, bounce.golf.GOLF, {"omega": 2.0}, 1e-13
    )
    exact, numeric = problem.jacobian(problem.initial), problem.differences(problem.initial)
    assert np.abs(exact - numeric).max() < 1e-7


@pytest.mark.slow
def test_coverage():
    """Of 40 fits, a 90 % interval contains the exact value in 36 +- 6 (three standard deviations)."""
    law = bounce.laws.TiltedBounce(mu=0.25, restitution=0.4, tilt=0.2)
    hits = []
    for seed in range(40):
        found = bounce.golf.fit(
            law, synthetic(law, 40, 0.02, seed), parameters=["mu", "restitution", "tilt"], starts=0
        )
        reference = dict(mu=0.25, restitution=0.4, tilt=0.2)
        hits += [[low <= reference[n] <= high for n, (low, high) in found.interval(0.9).items()]]
    counts = np.sum(hits, axis=0)
    assert np.all(np.abs(counts - 36) <= 6), counts


@pytest.mark.slow
def test_noise_on_a_contact_model():
    found = bounce.golf.fit(
        GUESS, synthetic(TRUE, 40, 0.005), parameters=["mu", "eta", "d2"], starts=3, polish=1
    )
    for name, (low, high) in found.interval(0.999).items():
        assert low <= TRUE.values[name] <= high
    assert found.rms["ydot"] == pytest.approx(0.005, rel=0.4)
    assert "95 %" in repr(found) and "rms" in repr(found)
    json.dumps(found.to_dict())
    figure = bounce.plot.residuals(found)
    assert len(figure.axes) == 3 and "ydot" in figure.axes[1].get_xlabel()


def test_si_data_through_a_scaling():
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 2e4)
    raw = synthetic(TRUE, 12)
    unit = scaling.speed
    data = {
        f"{k} [rad/s]" if k.endswith("omega") else f"{k} [m/s]": v
        * unit
        / (bounce.golf.GOLF.radius if k.endswith("omega") else 1)
        for k, v in raw.items()
    }
    found = bounce.golf.fit(GUESS, data, parameters=["mu", "eta", "d2"], scaling=scaling, starts=4)
    assert found.values["mu"] == pytest.approx(0.3, rel=1e-6)
    assert found.measurements.si


def test_a_law_from_part_of_the_components():
    """The normal speed alone gives the restitution; what it does not depend on is said so."""
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.6)
    data = synthetic(law, 10, components=("ydot",))
    with pytest.warns(bounce.golf.IdentifiabilityWarning, match="mu"):
        found = bounce.golf.fit(
            law.replace(restitution=0.2), data, parameters=["restitution", "mu"], starts=3
        )
    assert found.values["restitution"] == pytest.approx(0.6, rel=1e-9)
    assert math.isinf(found.errors["mu"]) and math.isfinite(found.errors["restitution"])
    assert "not determined" in repr(found)


def test_multi_start_finds_what_one_start_misses():
    law = bounce.laws.TiltedBounce(mu=0.25, restitution=0.4, tilt=0.2)
    found = bounce.golf.fit(
        law.replace(mu=0.9, tilt=1.2, restitution=0.9),
        synthetic(law, 40),
        parameters=["mu", "restitution", "tilt"],
        starts=30,
    )
    assert found.values == pytest.approx(dict(mu=0.25, restitution=0.4, tilt=0.2), rel=1e-6)
    assert len(found.starts) == 31
    again = bounce.golf.fit(law, synthetic(law, 40), parameters=["mu"], starts=[{"mu": 0.4}])
    assert [s.values["mu"] for s in again.starts] == [0.25, 0.4]


def test_rows_that_cannot_be_simulated_are_named():
    model = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.15, eta=0.5, G=0.05)
    data = synthetic(model, 12)
    data["ydot"][4] = -1e-3  # too slow: gravity keeps it in the ground
    with pytest.raises(bounce.golf.DataError, match=r"row 5: .*bad_rows"):
        bounce.golf.fit(model, data, parameters=["mu"], starts=0)
    found = bounce.golf.fit(model, data, parameters=["mu"], starts=0, bad_rows="leave out")
    assert [row for row, _ in found.measurements.left_out] == [5]
    assert "left out: row 5" in repr(found)
    assert found.values["mu"] == pytest.approx(0.3, rel=1e-6)


def test_bounds():
    data = synthetic(TRUE, 10)
    found = bounce.golf.fit(TRUE, data, parameters=["mu"], bounds={"mu": (0.35, 0.6)}, starts=2)
    assert found.values["mu"] == pytest.approx(0.35, abs=1e-6) and found.at_bound == ("mu",)


DATA = synthetic(bounce.laws.RigidBounce(mu=0.3, restitution=0.5), 5)
UNITS = {f"{k} [rad/s]" if "omega" in k else f"{k} [m/s]": v for k, v in DATA.items()}


@pytest.mark.parametrize(
    ("model", "data", "options", "error", "message"),
    [
        (TRUE, DATA, dict(parameters=["nu"]), ns.ParameterError, "nu"),
        (TRUE, DATA, dict(parameters=[]), ns.ParameterError, "parameters"),
        (bounce.laws.PennerBounce(), UNITS, dict(parameters=["tilt"]), ns.ParameterError, "tilt"),
        (TRUE, UNITS, dict(parameters=["mu"]), bounce.ModelError, "scaling"),
        ("turf", DATA, dict(parameters=["mu"]), bounce.ModelError, "model"),
        (TRUE, DATA, dict(parameters=["mu"], weights={"slip": 1.0}), ns.OptionError, "weights"),
        (TRUE, DATA, dict(parameters=["mu"], bounds={"eta": (0, 1)}), ns.OptionError, "bounds"),
        (
            TRUE,
            DATA,
            dict(parameters=["mu"], bounds={"mu": (-2, -1)}),
            ns.OptionError,
            "bounds: mu",
        ),
        (TRUE, DATA, dict(parameters=["mu"], starts=-1), ns.OptionError, "starts"),
        (TRUE, DATA, dict(parameters=["mu"], starts=[{"eta": 1.0}]), ns.OptionError, "starts"),
        (TRUE, DATA, dict(parameters=["mu"], bad_rows="drop"), ns.OptionError, "bad_rows"),
        (
            TRUE,
            {k: v[:1] for k, v in DATA.items()},
            dict(parameters=["mu", "eta", "d1"]),
            bounce.golf.FitError,
            "data",
        ),
    ],
)
def test_messages(model, data, options, error, message):
    with pytest.raises(error, match=message):
        bounce.golf.fit(model, data, **options)


def wild(seed):
    """Four bounces that no law has: the fit drifts to where nothing depends on mu."""
    rng = np.random.default_rng(seed)
    u, v, w = rng.uniform(15, 25, 4), -rng.uniform(10, 18, 4), rng.uniform(100, 300, 4)
    return {
        "xdot [m/s]": u, "ydot [m/s]": v, "omega [rad/s]": w,
        "lift_off_xdot [m/s]": u * 0.4 + rng.normal(size=4),
        "lift_off_ydot [m/s]": -0.4 * v, "lift_off_omega [rad/s]": -w,
    }  # fmt: skip


@pytest.mark.parametrize("seed", [0, 15, 23, 34])
def test_a_parameter_that_the_data_do_not_determine_is_reported(seed):
    law = bounce.laws.TURFS["natural"].law
    with pytest.warns(bounce.golf.IdentifiabilityWarning, match="mu") as caught:
        found = bounce.golf.fit(law, wild(seed), parameters=["mu", "restitution", "tilt"])
    assert caught[0].filename == __file__
    assert found.undetermined == ("mu",)
    assert found.to_dict()["undetermined"] == ["mu"]
    assert "mu = " in repr(found) and "(not determined by these data)" in repr(found)
    assert found.condition > 1e6
    assert found.to_dict()["errors"]["mu"] is None or found.to_dict()["errors"]["mu"] > 1e6
    json.loads(json.dumps(found.to_dict(), allow_nan=False))


def test_parameters_that_only_their_product_fixes():
    """The normal force of Hertz's law at depth y is stiffness y^1.5: a spring has one number."""

    class TwoSprings(bounce.ContactModel):
        parameters = dict(mu=0.3, one=1.0, other=1.0)
        limits = dict(one="> 0", other="> 0")

        def normal_force(self, s, p):
            return -p.one * p.other * s.y - 0.2 * s.ydot

        def tangential_force(self, s, p):
            return 0

    data = synthetic(TwoSprings(one=2.0), 8)
    with pytest.warns(bounce.golf.IdentifiabilityWarning, match="one: .*other: "):
        found = bounce.golf.fit(TwoSprings(), data, parameters=["one", "other"], starts=0)
    assert found.undetermined == ("one", "other")
    assert found.values["one"] * found.values["other"] == pytest.approx(2.0, rel=1e-6)


def test_good_data_are_no_cause_for_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        guess = GUESS.replace(d2=TRUE.values["d2"])  # a wrong one that stays is a cause
        found = bounce.golf.fit(
            guess, synthetic(TRUE, 15, 0.01), parameters=["mu", "eta"], starts=0
        )
    assert found.undetermined == () and 1.0 <= found.condition < 100.0
