"""``device="cuda"`` refuses what it does not run, and says what is missing where there is no card."""

import importlib.util

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine.device import card
from nonsmooth.flow.ensembles.on_device import device_chunk


def pair(**more):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    return ns.FilippovSystem([x, y], surface=x, above=[-1, 0], below=[1, 0], **more)


def two_surfaces():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    lam = ca.SX.sym("lam", 2)
    return ns.FilippovSystem([x, y], surfaces=[x, y], field=[-lam[0], -lam[1]], multipliers=lam)


def falling():
    y, v = ca.SX.sym("y"), ca.SX.sym("v")
    return ns.FilippovSystem([y, v], field=[v, -1], resets=[ns.Reset(y, [y, -0.5 * v], -1)])


@pytest.mark.parametrize(
    ("system", "options", "said"),
    [
        (two_surfaces(), {}, "several surfaces"),
        (falling(), {}, "resets"),
        (pair(), {"start_mode": "s"}, "start_mode"),
        (pair(), {"t_eval": [0.5]}, "t_eval"),
        (pair(), {"rest_below": 0.1}, "rest_below"),
        (pair(), {"method": "stiff"}, "implicit steps"),
        (pair(), {"t_end": 0.0}, "t_end"),
    ],
)
def test_refusals(system, options, said):
    with pytest.raises(ns.OptionError, match=f"^device .*{said}"):
        ns.ensemble(system, [[1.0, 1.0]], device="cuda", **{"t_end": 1.0, **options})


@pytest.mark.parametrize(("n", "least"), [(2, 1 << 22), (300, 1 << 17)])
def test_memory_of_a_call_is_bounded(n, least):
    x = ca.SX.sym("x", n)
    count = device_chunk(ns.FilippovSystem(x, surface=x[0], above=-x, below=x))
    assert least <= count <= min(1 << 22, (1 << 31) / (3 * 8 * n))


def test_other_devices_are_refused():
    with pytest.raises(ns.OptionError, match=r"device.*'tpu'"):
        ns.ensemble(pair(), [[1.0, 1.0]], 1.0, device="tpu")


@pytest.mark.skipif(importlib.util.find_spec("cuda") is not None, reason="cuda-core is there")
def test_without_packages_the_error_says_what_to_install():
    with pytest.raises(card.DeviceError, match=r"cuda-core.*nonsmooth-dynamics\[cuda\]"):
        ns.ensemble(pair(), np.ones((3, 2)), 1.0, device="cuda")


def test_without_a_driver_the_error_says_so():
    class Core:
        def Device(self):
            raise RuntimeError("Ensure the NVIDIA display driver is installed.")

    with pytest.raises(card.DeviceError, match=r"NVIDIA.*display driver"):
        card.Card(Core())
