"""Cross's law throws the slip back, or exhausts friction."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import bounce

LANDINGS = dict(xdot=st.floats(-30, 30), ydot=st.floats(-30, -0.1), omega=st.floats(-30, 30))


@given(**LANDINGS)
def test_cross_reverses_the_slip_or_exhausts_friction(xdot, ydot, omega):
    law = bounce.laws.CrossBounce(mu=0.3, restitution=0.5, tangential_restitution=0.4)
    after, before = law.lift_off(xdot, ydot, omega), xdot + omega
    cone = 0.3 * after.normal_impulse
    assert abs(after.tangential_impulse) <= cone * (1 + 1e-14)
    assert after.slip == pytest.approx(after.xdot + after.omega, abs=1e-12 * 60)
    if str(after.case).startswith("grip"):
        assert after.slip == pytest.approx(-0.4 * before, abs=1e-12)
    else:
        assert abs(after.tangential_impulse) == pytest.approx(cone)
