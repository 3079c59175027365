"""An installed wheel finds the period of a stick-slip oscillator and runs an ensemble without a C compiler."""

import os
import tempfile
import warnings

import casadi as ca
import numpy as np

import nonsmooth as ns

warnings.simplefilter("error")  # a wheel without its library warns, and computes in Python
os.environ.update(PATH="", CC="", NONSMOOTH_CACHE=tempfile.mkdtemp())

x, v, lam = (ca.SX.sym(name) for name in ("x", "v", "lam"))
slip = v - 0.3
block = ns.FilippovSystem(
    [x, v], surface=slip, multipliers=lam, field=[v, -x - 0.5 * lam + 0.2 * slip]
)
run = ns.simulate(block, [0.0, 0.0], t_end=30.0)
exits = [event.t for event in run.events if event.kind == "exit"]
assert abs(exits[2] - exits[1] - 6.736837191765135) < 1e-9, exits
many = ns.ensemble(block, np.zeros((3, 2)), t_end=30.0)
assert np.allclose(many.x, run.x[-1], rtol=1e-9, atol=1e-9)
print(ns.__version__, ns.__file__, "is installed and right")
