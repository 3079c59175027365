"""Siconos: a chain of blocks on a belt by its time-stepping scheme, in an interpreter that has Siconos.

Run by ``benchmarks.burridge_knopoff`` as a script: it imports nothing of this project. Moreau's time stepping with
relays, of order one at switches; each step solves a linear complementarity problem by Lemke's method.
"""

import json
import sys
import time

import numpy as np
import siconos.kernel as sk
import siconos.numerics as sn


def run(t_end, h, matrix, offset, rates, shift, push, start):
    """Return the state at t_end and the seconds of the loop."""
    block = sk.FirstOrderLinearDS(np.array(start), np.array(matrix), np.array(offset))
    relation = sk.FirstOrderLinearTIR(np.array(rates), np.array(push))
    relation.setePtr(np.array(shift))
    count = len(shift)
    interaction = sk.Interaction(sk.RelayNSL(count, -1.0, 1.0), relation)
    model = sk.NonSmoothDynamicalSystem(0.0, t_end)
    model.insertDynamicalSystem(block)
    model.link(interaction, block)
    stepping = sk.TimeStepping(
        model,
        sk.TimeDiscretisation(0.0, h),
        sk.EulerMoreauOSI(0.5),
        sk.Relay(sn.SICONOS_RELAY_LEMKE),
    )
    begin = time.process_time()
    while stepping.hasNextEvent():
        stepping.computeOneStep()
        stepping.nextStep()
    return block.x().tolist(), time.process_time() - begin


def main():
    """Read the problem from the standard input, print the rows."""
    problem = json.load(sys.stdin)
    steps = problem.pop("steps")
    rows = []
    for h in steps:
        x, seconds = run(h=h, **problem)
        rows.append({"tolerance": h, "x": x, "seconds": seconds})
    print(json.dumps({"version": "4.4.0", "rows": rows}))


if __name__ == "__main__":
    main()
