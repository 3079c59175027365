"""Systems that the kernels run, and what a machine makes of starts."""

import casadi as ca

import nonsmooth as ns
import nonsmooth.textbook as textbook
from nonsmooth.flow.engine.building.codegen import supports_device
from nonsmooth.flow.engine.device.kernel import Given, Kernel, Source
from nonsmooth.flow.results import Chunk

#: Textbook problems for a card.
TAKEN = sorted(
    name
    for name in textbook.PROBLEMS
    if supports_device(textbook.by_name(name).system) and not textbook.by_name(name).system.sets
)


def block_on_a_belt():
    x, v, t, belt, friction = (ca.SX.sym(s) for s in ("x", "v", "t", "belt", "friction"))
    return ns.FilippovSystem(
        [x, v],
        surface=v - belt,
        above=[v, -x - friction - 0.1 * v + 0.2 * t],
        below=[v, -x + friction - 0.1 * v + 0.2 * t],
        parameters={belt: 0.3, friction: 0.4},
        stops=[ns.Stop(x + 1.5, -1, "far")],
        time=t,
    )


def ends(machine, system, x, options, p=None, at=None):
    """Results of a machine, without runs that fall back to the driver."""
    chunk = Chunk.empty(len(x), system, at is not None)
    p = system.parameter_vector() if p is None else p
    kernel = Kernel(system, options.order, machine)
    kernel.run(Given(Source.rows(x[:, : system.dimension]), 0, len(x), p, options), at, chunk)
    return chunk
