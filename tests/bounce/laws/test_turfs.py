"""The turfs have the values that were published, each with its source."""

import math

import bounce


def test_published_values():
    laws = {name: fit.law for name, fit in bounce.laws.TURFS.items()}
    tilted = {
        n: (law.values["mu"], law.restitution, law.tilt)
        for n, law in laws.items()
        if n in ("natural", "artificial")
    }
    assert tilted["natural"] == (0.998, 0.147, math.radians(18.4))
    assert tilted["artificial"] == (0.852, 0.420, math.radians(12.9))
    assert laws["natural-rigid"] == bounce.laws.RigidBounce(mu=0.998, restitution=0.260)
    assert laws["artificial-rigid"] == bounce.laws.RigidBounce(mu=0.997, restitution=0.544)
    assert laws["penner"] == bounce.laws.PennerBounce()
    assert all(fit.source and fit.checked for fit in bounce.laws.TURFS.values())
