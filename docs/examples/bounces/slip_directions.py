"""A vortex instead of a dividing curve

A ball that travels forward lands with backspin and with spin about its direction of travel. The colour
is the direction of its slip at lift-off: light forward, dark in reverse, yellow to the right, blue to the
left. In the plane (the line at the middle) the slip changes its sign at one spin; with side spin it turns
around that spin, a vortex. Balls that land near it leave with almost any slip.
"""

import numpy as np

import bounce

turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
spins = np.linspace(0.0, 2.6, 60), np.linspace(-1.3, 1.3, 60)
directions = bounce.slip_map(turf, [1.0, 0.0], spins, tol=1e-8)
(vortex,) = bounce.maps.find_vortices(turf, [1.0, 0.0])

figure = bounce.plot.slip_map(directions)
etas = np.array([0.01, 0.02, 0.05, 0.1, 0.2])
turned = bounce.maps.slip_turn(turf, [2.0, 0.0], [0.5, 1.0], etas)

if __name__ == "__main__":
    print(directions, vortex, np.degrees(turned.turn), np.degrees(turned.first_order))
    figure.savefig("slip_directions.png")
