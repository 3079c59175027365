"""The kernels compile to machine code of three generations of cards, with the registers and the stack that they are
known to need. On an H200 the same kernels with 168 and 128 registers, which spill 1.8 to 2.6 and 2.5 to 4.6 times
as many bytes, made 0.47 to 0.63 and 0.31 to 0.38 times the bounces a second of those with 255."""

import ctypes
import importlib.util
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from benchmarks.problems import bounce_system
from nonsmooth.flow.engine.building.codegen import device_source
from nonsmooth.flow.engine.device.card import Card
from nonsmooth.flow.ensembles.on_device import device_order
from nonsmooth.flow.options import Options


def library():
    """Where NVRTC is, or None."""
    for name in ("nvidia.cu13", "nvidia.cuda_nvrtc"):
        try:
            spec = importlib.util.find_spec(name)
        except ModuleNotFoundError:
            spec = None
        for folder in (spec.submodule_search_locations or []) if spec is not None else []:
            found = sorted((Path(folder) / "lib").glob("libnvrtc.so.1*"))
            if found:
                return found[0]
    return None


@dataclass
class Compiled:
    """Machine code, and what ptxas says of one kernel: registers, bytes of stack, of spills written and read."""

    code: bytes
    registers: int
    stack: int
    stores: int
    loads: int


OPTIONS = (
    "--std=c++17",
    "--device-as-default-execution-space",
    "--disable-warnings",
    "--fmad=true",
    "--ptxas-options=-v",
)


def compiled(source, arch, kernel):
    """Compile for an architecture such as ``sm_90``; AssertionError with the log where that fails."""
    nvrtc, program, size = ctypes.CDLL(str(library())), ctypes.c_void_p(), ctypes.c_size_t()
    name = ctypes.c_char_p(b"engine.cu")
    assert (
        nvrtc.nvrtcCreateProgram(ctypes.byref(program), source.encode(), name, 0, None, None) == 0
    )
    words = [f"--gpu-architecture={arch}".encode(), *(o.encode() for o in OPTIONS)]
    code = nvrtc.nvrtcCompileProgram(program, len(words), (ctypes.c_char_p * len(words))(*words))
    nvrtc.nvrtcGetProgramLogSize(program, ctypes.byref(size))
    log = ctypes.create_string_buffer(size.value)
    nvrtc.nvrtcGetProgramLog(program, log)
    assert code == 0, log.value.decode()
    nvrtc.nvrtcGetCUBINSize(program, ctypes.byref(size))
    image = ctypes.create_string_buffer(size.value)
    nvrtc.nvrtcGetCUBIN(program, image)
    nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
    said = log.value.decode().split(f"Compiling entry function '{kernel}'")[1]
    said = said.split("Compiling entry")[0]
    own = re.search(
        r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads", said
    )
    registers = re.search(r"Used (\d+) registers", said)
    assert own and registers, said
    return Compiled(image.raw, int(registers[1]), *map(int, own.groups()))


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(library() is None, reason="no NVRTC: pip install nvidia-cuda-nvrtc"),
]

#: Bytes of stack, and of spills written and read, of NVRTC 13.5 and at most an eighth more.
CEILINGS = {
    ("linear", "sm_80"): (660, 675, 690),
    ("linear", "sm_90"): (725, 740, 755),
    ("linear", "sm_100"): (390, 400, 415),
    ("nonlinear", "sm_80"): (825, 875, 865),
    ("nonlinear", "sm_90"): (825, 850, 945),
    ("nonlinear", "sm_100"): (835, 890, 945),
}


@pytest.mark.parametrize(("name", "arch"), CEILINGS)
def test_registers_and_stack(name, arch):
    source = device_source(bounce_system(name), device_order(Options(t_end=1.0)), Card.threads)
    found = compiled(source, arch, "trajectories")
    assert found.code[:4] == b"\x7fELF"
    # A block fills the registers of a multiprocessor, 65,536.
    assert found.registers <= 255 and Card.threads * 256 <= 65536
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
