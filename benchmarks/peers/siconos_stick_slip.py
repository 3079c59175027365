"""Siconos: the stick-slip run by its time-stepping scheme, in an interpreter that has Siconos.

Run by ``benchmarks.other_interpreters`` as a script: it imports nothing of this project. The forcing is a
harmonic oscillator among the states, which makes the system linear with a relay. Its event-driven
scheme does not take relays, so this is Moreau's time stepping, of order one at switches.
"""

import json
import sys
import time

import numpy as np
import siconos.kernel as sk


def run(belt, t_end, h, A, c, omega, F, start):
    """Return the state at t_end and the seconds of the loop."""
    matrix = np.array(
        [[0, 1, 0, 0], [-1, -c, A, 0], [0, 0, 0, -omega], [0, 0, omega, 0]], dtype=float
    )
    block = sk.FirstOrderLinearDS([*start, 1.0, 0.0], matrix)
    relation = sk.FirstOrderLinearTIR(
        np.array([[0.0, 1.0, 0.0, 0.0]]), np.array([[0.0], [F], [0.0], [0.0]])
    )
    relation.setePtr(np.array([-belt]))
    interaction = sk.Interaction(sk.RelayNSL(1, -1.0, 1.0), relation)
    model = sk.NonSmoothDynamicalSystem(0.0, t_end)
    model.insertDynamicalSystem(block)
    model.link(interaction, block)
    stepping = sk.TimeStepping(
        model, sk.TimeDiscretisation(0.0, h), sk.EulerMoreauOSI(0.5), sk.Relay()
    )
    begin = time.process_time()
    while stepping.hasNextEvent():
        stepping.computeOneStep()
        stepping.nextStep()
    return block.x()[:2].tolist(), stepping.startingTime(), time.process_time() - begin


def main():
    """Read the problem from the command line, print the rows."""
    problem = json.load(sys.stdin)
    steps = problem.pop("steps")
    rows = []
    for h in steps:
        x, t, seconds = run(h=h, **problem)
        rows.append({"tolerance": h, "x": x, "t": t, "seconds": seconds})
    print(json.dumps({"version": "4.4.0", "rows": rows}))


if __name__ == "__main__":
    main()
