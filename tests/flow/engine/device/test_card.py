"""What drives a card asks cuda-core for what it needs and no more, in its words; the card here is this processor."""

import ctypes
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.engine.device.card import Card
from nonsmooth.flow.ensembles import on_device
from tests.flow.engine.device.shim import Shim

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


class Buffer:
    """``cuda.core.Buffer``: bytes at an address, copied on a stream."""

    def __init__(self, size):
        self.bytes, self.size = (ctypes.c_uint8 * size)(), size

    @property
    def handle(self):
        return ctypes.addressof(self.bytes)

    def copy_from(self, src, *, stream):
        assert stream == "stream" or isinstance(stream, SimpleNamespace)
        assert src.size == self.size
        ctypes.memmove(self.handle, src.handle, self.size)

    def close(self, stream=None):
        self.bytes = None

    @classmethod
    def from_handle(cls, ptr, size, *, owner):
        made = cls(0)
        made.bytes, made.size = (ctypes.c_uint8 * size).from_buffer(owner.bytes), size
        assert made.handle == ptr
        return made


class Core:
    """As much of ``cuda.core`` 1.2 as is used, with its signatures, on the shim."""

    Buffer = Buffer

    def __init__(self):
        self.shim = Shim(fused=False)
        self.LegacyPinnedMemoryResource = lambda: SimpleNamespace(
            allocate=lambda size, *, stream=None: Buffer(size)
        )
        self.launched = []

    def Device(self):
        stream = SimpleNamespace(sync=lambda: None)
        return SimpleNamespace(
            set_current=lambda: None,
            default_stream=stream,
            name="none",
            arch="90",
            properties=SimpleNamespace(multiprocessor_count=2),
            allocate=lambda size, *, stream: Buffer(size),
        )

    def ProgramOptions(
        self, *, arch, std, device_as_default_execution_space, disable_warnings, fma
    ):
        assert arch == "sm_90"
        assert std == "c++17" and device_as_default_execution_space and fma
        return "options"

    def Program(self, code, code_type, options):
        assert (code_type, options) == ("c++", "options")
        kernels = self.shim.compile(code)
        found = SimpleNamespace(get_kernel=lambda name: (kernels, name))
        return SimpleNamespace(compile=lambda target: found if target == "cubin" else None)

    def LaunchConfig(self, *, grid, block):
        return grid, block

    def launch(self, stream, config, kernel, *arguments):
        assert all(isinstance(a, (np.int64, np.float64, Buffer)) for a in arguments)
        self.shim.blocks, self.shim.threads = (
            config[0],
            1,
        )  # threads have their starts by their number
        self.launched.append((kernel[1], config))
        addresses = [np.int64(a.handle) if isinstance(a, Buffer) else a for a in arguments]
        self.shim.launch(*kernel, addresses)


def test_an_ensemble_by_way_of_cuda_core(monkeypatch):
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    system = ns.FilippovSystem([x, v], surface=v - 0.2, above=[v, -x - 1], below=[v, -x + 1])
    core = Core()
    card = Card(core)
    monkeypatch.setattr(on_device, "machine_for", lambda device: card)
    starts = ns.RandomStarts(40, [-2.0, -1.0], [2.0, 1.0], seed=3)
    options = dict(t_end=4.0, tol=1e-5, at_event=("entry", 1), work=ns.Work(chunk=25))
    there, here = (
        ns.ensemble(system, starts, device="cuda", **options),
        ns.ensemble(system, starts, **options),
    )
    assert [name for name, _ in core.launched] == ["parameters", "trajectories"] * 2
    assert core.launched[1][1] == (4, 128)
    assert np.array_equal(there.itinerary, here.itinerary)
    np.testing.assert_allclose(there.x, here.x, rtol=0, atol=1e-7)
    np.testing.assert_allclose(there.event_t, here.event_t, rtol=0, atol=1e-7)
    found = ns.outcomes(system, starts, device="cuda", t_end=4.0, tol=1e-5)
    assert found.itineraries == ns.outcomes(system, starts, t_end=4.0, tol=1e-5).itineraries
    assert found.mean["x"] == pytest.approx(here.x[:, 0].mean(), rel=0, abs=1e-7)


def test_the_beginning_of_memory_is_read():
    card, own = Card(Core()), np.empty((1, 2))
    card.read(card.write(np.arange(5.0)), own)
    assert own.tolist() == [[0.0, 1.0]]
    card.read(card.write(np.zeros(0)), np.zeros(0))
