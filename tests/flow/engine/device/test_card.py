"""The driver of a GPU uses cuda-core as documented, and no more than it needs; the GPU here is this processor."""

import ctypes
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.engine.device import card as card_module
from nonsmooth.flow.engine.device.card import Card, DeviceError
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
        assert isinstance(stream, Stream)
        assert src.size == self.size
        ctypes.memmove(self.handle, src.handle, self.size)

    @classmethod
    def from_handle(cls, ptr, size, *, owner):
        made, first = cls(0), ptr - owner.handle
        assert 0 <= first and first + size <= owner.size
        made.owner, made.size = owner, size
        made.bytes = (ctypes.c_uint8 * size).from_address(ptr)
        return made


class Event:
    """``cuda.core.Event``."""

    def sync(self):
        pass


class Stream:
    """``cuda.core.Stream``."""

    def record(self, event=None):
        return event or Event()


class Core:
    """As much of ``cuda.core`` 1.2 as is used, with its signatures, on the shim.

    ``refused``: what the driver cannot load; ``memory``: bytes of the card.
    """

    Buffer = Buffer

    def __init__(self, refused=(), memory=1 << 40):
        self.shim, self.refused, self.memory = Shim(fused=False), refused, memory
        self.LegacyPinnedMemoryResource = lambda: SimpleNamespace(
            allocate=lambda size, *, stream=None: Buffer(size)
        )
        self.launched, self.loaded = [], []

    def Device(self):
        return SimpleNamespace(
            set_current=lambda: None,
            default_stream=Stream(),
            name="none",
            arch="90",
            properties=SimpleNamespace(multiprocessor_count=2),
            allocate=self.allocate,
        )

    def allocate(self, size, *, stream):
        if size > self.memory:
            raise MemoryError("CUDA_ERROR_OUT_OF_MEMORY")
        return Buffer(size)

    def ProgramOptions(
        self, *, arch, std, device_as_default_execution_space, disable_warnings, fma
    ):
        assert std == "c++17" and device_as_default_execution_space
        return arch

    def Program(self, code, code_type, options):
        assert code_type == "c++"

        def compile(target):
            return SimpleNamespace(get_kernel=lambda name: self.load(code, target, options, name))

        return SimpleNamespace(compile=compile)

    def load(self, code, target, arch, name):
        if (target, arch) in self.refused:
            raise RuntimeError("CUDA_ERROR_UNSUPPORTED_PTX_VERSION")
        self.loaded.append((target, arch))
        return self.shim.compile(code), name

    def LaunchConfig(self, *, grid, block):
        return grid, block

    def launch(self, stream, config, kernel, *arguments):
        assert all(isinstance(a, (np.int64, np.float64, Buffer)) for a in arguments)
        # Threads have their starts by their number.
        self.shim.blocks, self.shim.threads = config[0], 1
        self.launched.append((kernel[1], config))
        addresses = [np.int64(a.handle) if isinstance(a, Buffer) else a for a in arguments]
        self.shim.launch(*kernel, addresses)


def test_an_ensemble_by_way_of_cuda_core(monkeypatch):
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    system = ns.FilippovSystem([x, v], surface=v - 0.2, above=[v, -x - 1], below=[v, -x + 1])
    core = Core()
    use(monkeypatch, core)
    starts = ns.RandomStarts(40, [-2.0, -1.0], [2.0, 1.0], seed=3)
    options = dict(t_end=4.0, tol=1e-5, at_event=("entry", 1), work=ns.Work(chunk=25))
    there, here = (
        ns.ensemble(system, starts, device="cuda", **options),
        ns.ensemble(system, starts, **options),
    )
    names = [name for name, _ in core.launched]
    assert names[:3] == ["parameters", "trajectories", "numbered"]
    assert core.launched[1][1] == (2, 256)
    assert np.array_equal(there.itinerary, here.itinerary)
    np.testing.assert_allclose(there.x, here.x, rtol=0, atol=1e-7)
    np.testing.assert_allclose(there.event_t, here.event_t, rtol=0, atol=1e-7)
    found = ns.outcomes(system, starts, device="cuda", t_end=4.0, tol=1e-5)
    assert found.itineraries == ns.outcomes(system, starts, t_end=4.0, tol=1e-5).itineraries
    assert found.mean["x"] == pytest.approx(here.x[:, 0].mean(), rel=0, abs=1e-7)


@pytest.mark.parametrize("size", [0, 1, 7, 8, 9, 16, 100])
def test_arrays_are_copied_by_two_buffers(monkeypatch, size):
    monkeypatch.setattr(card_module, "_STAGED", 64)
    card, array = Card(Core()), np.arange(float(size))
    memory = card.write(array)
    for own in (np.empty(size), np.empty(size // 2), np.empty((size, 2))[:, 0]):
        card.read(memory, own)
        assert np.array_equal(own, array[: len(own)])
    assert len(card._staging) <= 2


def use(monkeypatch, core):
    """``device="cuda"`` runs on a stand-in."""
    card = Card(core)
    monkeypatch.setattr(on_device, "machine_for", lambda device: card)


def small():
    x = ca.SX.sym("x")
    return ns.FilippovSystem([x], surface=x, above=[-1], below=[3])


@pytest.mark.parametrize(
    ("refused", "loaded"),
    [
        ((), ("cubin", "sm_90")),
        ((("cubin", "sm_90"),), ("ptx", "sm_90")),
        ((("cubin", "sm_90"), ("ptx", "sm_90")), ("ptx", "sm_80")),
    ],
)
def test_what_the_driver_does_not_load_it_compiles_from_ptx(monkeypatch, refused, loaded):
    core = Core(refused)
    use(monkeypatch, core)
    assert ns.ensemble(small(), [[-1.0]], 0.4, device="cuda").itinerary.tolist() == ["- s"]
    assert set(core.loaded) == {loaded}


def test_errors_are_device_errors(monkeypatch):
    every = [("cubin", "sm_90"), ("ptx", "sm_90"), ("ptx", "sm_80")]
    for core, said in (
        (Core(every), "compile.*cubin of sm_90.*UNSUPPORTED.*ptx of sm_80"),
        (Core(memory=1000), r"allocate memory.*OUT_OF_MEMORY.*chunk"),
    ):
        use(monkeypatch, core)
        with pytest.raises(DeviceError, match=said):
            ns.ensemble(small(), [[-1.0]] * 30, 0.4, device="cuda")

    def fail(*arguments):
        raise RuntimeError("CUDA_ERROR_ILLEGAL_ADDRESS")

    core = Core()
    core.launch = fail
    use(monkeypatch, core)
    with pytest.raises(DeviceError, match="cannot run on none: RuntimeError: CUDA_ERROR_ILL"):
        ns.ensemble(small(), [[-1.0]], 0.4, device="cuda")
