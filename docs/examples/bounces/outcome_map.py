"""What becomes of a landing, and the curve that divides

Every point is a landing, its colour the itinerary of the bounce: slip (S+, S-) and rolling (R). On
the dividing curve the ball lifts off without slip. Along one part it rolls into the two-fold, along
the other it slips up to the last moment; to one side it leaves with forward slip, to the other in
reverse.
"""

import numpy as np

import bounce

turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
speeds, spins = np.linspace(-2, 2, 400), np.linspace(-4, 4, 400)
outcomes = bounce.outcome_map(turf, over={"xdot": speeds, "omega": spins})
curve = bounce.dividing_curve(turf, ydot=-1.0)

figure = bounce.plot.outcome_map(outcomes, curve=curve)

if __name__ == "__main__":
    print(curve, outcomes.share())
    figure.savefig("outcome_map.png")
