"""nosnoc: the stick-slip run by finite elements with switch detection, in an interpreter that has it.

Run by ``benchmarks.other_interpreters`` as a script: it imports nothing of this project. Every step is a
nonlinear program with complementarity constraints, solved by IPOPT. nosnoc has no terminal events,
so the bounces, which end at lift-off, are not posed to it.
"""

import contextlib
import io
import json
import sys
import time
from importlib.metadata import version

import casadi as ca
import nosnoc
import numpy as np


def run(belt, t_end, h, A, c, omega, F, start):
    """Return the state at t_end and the seconds of the loop, the set-up not counted."""
    x, v, t = (ca.SX.sym(s) for s in ("x", "v", "t"))
    free = -x - c * v + A * ca.cos(omega * t)
    fields = ca.horzcat(ca.vertcat(v, free - F, 1), ca.vertcat(v, free + F, 1))
    model = nosnoc.NosnocModel(
        x=ca.vertcat(x, v, t),
        F=[fields],
        S=[np.array([[1], [-1]])],
        c=[v - belt],
        x0=np.array([*start, 0.0]),
    )
    options = nosnoc.NosnocOpts()
    options.n_s = 4
    options.N_finite_elements = 3
    options.terminal_time = h
    options.comp_tol = 1e-12
    options.sigma_N = 1e-12
    options.step_equilibration = nosnoc.StepEquilibrationMode.L2_RELAXED_SCALED
    solver = nosnoc.NosnocSolver(options, model)
    looper = nosnoc.NosnocSimLooper(solver, model.x0, round(t_end / h))
    begin = time.process_time()
    looper.run()
    end = np.asarray(looper.get_results()["X_sim"])[-1].ravel()
    return end[:2].tolist(), float(end[2]), time.process_time() - begin


def main():
    """Read the problem from the command line, print the rows."""
    problem = json.load(sys.stdin)
    steps = problem.pop("steps")
    rows = []
    for h in steps:
        with contextlib.redirect_stdout(io.StringIO()):
            x, t, seconds = run(h=h, **problem)
        rows.append({"tolerance": h, "x": x, "t": t, "seconds": seconds})
    print(json.dumps({"version": version("nosnoc"), "rows": rows}))


if __name__ == "__main__":
    main()
