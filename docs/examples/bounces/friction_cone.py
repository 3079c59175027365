"""A bounce in its friction cone

Friction against load, from touch-down to lift-off. The ball slips along an edge of the cone, rolls
inside it, and leaves at the tip. To roll up to the tip it would have to thread the two-fold that is
there, so almost every ball slips again just before: this one in reverse, which rigid ground cannot
do.
"""

import bounce

turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
shot = bounce.simulate(turf, xdot=0.3, ydot=-1.0, omega=0.1)

figure = bounce.plot.friction_cone(shot)

if __name__ == "__main__":
    print(shot.itinerary, shot.slip, shot.time)
    figure.savefig("friction_cone.png")
