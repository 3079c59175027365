"""Friction in the plane in Siconos: time stepping of Moreau and Jean, one second-order cone.

Run by the interpreter that has Siconos, with a list of runs as JSON; prints a line of JSON for each. A run has
``matrices`` mass, damping and stiffness, ``relation`` (3, n) from velocities to those of the contact (normal
first), ``start`` and ``speed``, ``force``, ``mu``, ``t_end``, ``step``.
"""

import json
import sys
import time

import numpy as np
import siconos.kernel as sk


def run(of):
    """Coordinates and velocities at the end, processor seconds, steps whose cone was not solved."""
    mass, damping, stiffness = (np.array(of[name]) for name in ("mass", "damping", "stiffness"))
    body = sk.LagrangianLinearTIDS(of["start"], of["speed"], mass, stiffness, damping)
    body.setFExtPtr(of["force"])
    contact = sk.Interaction(
        sk.NewtonImpactFrictionNSL(0.0, 0.0, of["mu"], 3),
        sk.LagrangianLinearTIR(np.array(of["relation"])),
    )
    model = sk.NonSmoothDynamicalSystem(0.0, of["t_end"])
    model.insertDynamicalSystem(body)
    model.link(contact, body)
    cone = sk.FrictionContact(3)
    cone.numericsSolverOptions().dparam[0] = 1e-12
    grid = sk.TimeDiscretisation(0.0, of["step"])
    steps = sk.TimeStepping(model, grid, sk.MoreauJeanOSI(0.5), cone)
    begin = time.process_time()
    while steps.hasNextEvent():
        steps.computeOneStep()
        steps.nextStep()
    seconds = time.process_time() - begin
    return [*body.q()], [*body.velocity()], seconds


for number, of in enumerate(json.loads(sys.argv[1])):
    try:
        place, speed, seconds = run(of)
        print(json.dumps(dict(run=number, place=place, speed=speed, seconds=seconds)), flush=True)
    except Exception as error:  # what fails is a result too
        print(json.dumps(dict(run=number, failure=f"{type(error).__name__}: {error}")), flush=True)
