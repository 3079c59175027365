"""A block on an incline in Siconos: time stepping of Moreau and Jean, one second-order cone.

Run by the interpreter that has Siconos: ``python siconos_incline.py H ...`` prints a line for each step.
"""

import json
import sys
import time

import numpy as np
import siconos.kernel as sk

MU, SLOPE, T_END = 0.7, 0.4, 4.91171510210042615824384
END = (1.50886027451038765470960, 1.48581145486294845964079)


def run(h):
    """Place along the incline at the end, and processor seconds."""
    block = sk.LagrangianLinearTIDS([0.0, 0.0, 0.0], [0.0, 0.5, 1.2], np.eye(3))
    block.setFExtPtr([-np.cos(SLOPE), np.sin(SLOPE), 0.0])
    contact = sk.Interaction(
        sk.NewtonImpactFrictionNSL(0.0, 0.0, MU, 3), sk.LagrangianLinearTIR(np.eye(3))
    )
    model = sk.NonSmoothDynamicalSystem(0.0, T_END)
    model.insertDynamicalSystem(block)
    model.link(contact, block)
    cone = sk.FrictionContact(3)
    cone.numericsSolverOptions().dparam[0] = 1e-12
    steps = sk.TimeStepping(model, sk.TimeDiscretisation(0.0, h), sk.MoreauJeanOSI(0.5), cone)
    begin = time.process_time()
    while steps.hasNextEvent():
        steps.computeOneStep()
        steps.nextStep()
    return list(block.q())[1:], time.process_time() - begin


for step in map(float, sys.argv[1:]):
    place, seconds = run(step)
    error = max(abs(a - b) for a, b in zip(place, END, strict=True))
    print(json.dumps(dict(step=step, error=error, seconds=seconds)))
