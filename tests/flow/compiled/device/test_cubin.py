"""The kernels compile to machine code of three generations of cards, with the registers and the stack that they are
known to need: what spills more than that was made slower by a change."""

import pytest

from benchmarks.problems import bounce_system
from nonsmooth.flow.compiled.building.codegen import device_source
from nonsmooth.flow.compiled.device.card import Card
from nonsmooth.flow.options import Options
from tests.flow.compiled.device.nvrtc import compiled, library

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(library() is None, reason="no NVRTC: pip install nvidia-cuda-nvrtc"),
]

#: Bytes of stack, and of spills written and read, of NVRTC 13.5 and an eighth more.
CEILINGS = {
    ("linear", "sm_80"): (820, 955, 895),
    ("linear", "sm_90"): (820, 955, 910),
    ("linear", "sm_100"): (640, 640, 730),
    ("nonlinear", "sm_80"): (985, 1155, 1090),
    ("nonlinear", "sm_90"): (1045, 1210, 1170),
    ("nonlinear", "sm_100"): (1300, 1405, 1530),
}


@pytest.mark.parametrize(("name", "arch"), CEILINGS)
def test_registers_and_stack(name, arch):
    source = device_source(bounce_system(name), Options(t_end=1.0).order, Card.threads)
    found = compiled(source, arch, "trajectories", "--fmad=true")
    assert found.code[:4] == b"\x7fELF"
    # Two blocks of a card fill its registers: 65,536 of a multiprocessor.
    assert found.registers <= 255 and 2 * Card.threads * 256 <= 65536
    stack, stores, loads = CEILINGS[name, arch]
    assert (found.stack <= stack, found.stores <= stores, found.loads <= loads) == (True,) * 3, (
        found
    )


def test_every_function_of_an_expression_compiles():
    """What fields may be made of, and parameters go through, has a name on the device."""
    import casadi as ca

    import nonsmooth as ns

    x, y, a = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("a")
    smooth = (ca.sin, ca.cos, ca.tanh, ca.exp, ca.atan, ca.sinh, ca.cosh, ca.erf, ca.asinh)
    field = (
        sum(f(0.1 * x) for f in smooth)
        + ca.sqrt(1 + x**2)
        + ca.log(2 + ca.cos(y))
        + y / (2 + ca.sin(x))
    )
    given = (
        ca.fabs(a)
        + ca.fmin(a, 1)
        + ca.floor(a)
        + ca.sign(a)
        + ca.if_else(a > 0, a, 2)
        + ca.erfinv(a / 9)
    )
    system = ns.FilippovSystem(
        [x, y], surface=x, above=[-1 + 0.1 * y, field], below=[1, given], parameters={a: 0.3}
    )
    assert compiled(device_source(system, 6, 128), "sm_90", "trajectories").registers <= 255
