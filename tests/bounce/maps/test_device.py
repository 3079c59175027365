"""Landings bounce on a GPU, here its kernels on this processor, as they do on the processor."""

import numpy as np
import pytest

import bounce
import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.ensembles import on_device
from tests.flow.engine.device.shim import Shim

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_lift_offs_and_maps(monkeypatch):
    monkeypatch.setattr(on_device, "machine_for", lambda device: Shim())
    over = {"xdot": np.linspace(0.1, 1.5, 8), "omega": np.linspace(-1, 1, 6)}
    there, here = (bounce.outcome_map(TURF, over, tol=1e-6, device=d) for d in ("cuda", None))
    assert there.regions == here.regions
    assert np.array_equal(there.code, here.code)
    np.testing.assert_allclose(there.slip, here.slip, rtol=0, atol=1e-8)
    np.testing.assert_allclose(there.lift_offs.time, here.lift_offs.time, rtol=0, atol=1e-8)


def test_landings_in_3d_are_refused(monkeypatch):
    with pytest.raises(ns.OptionError, match=r"^device .*a set of directions"):
        bounce.lift_off(TURF.in_3d(), [1.0, 0.0], -1.0, [0.2, 0.1], device="cuda")
