"""NVRTC by ctypes, from the wheel nvidia-cuda-nvrtc: CUDA C++ to PTX and to machine code, without a card or a driver."""

import ctypes
import importlib.util
import re
from dataclasses import dataclass
from pathlib import Path


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
)


def _run(source, arch, options, size_of, get):
    """Compile for an architecture, and return what ``get`` has of it, and the log; AssertionError with that if it fails."""
    nvrtc, program, size = ctypes.CDLL(str(library())), ctypes.c_void_p(), ctypes.c_size_t()
    name = ctypes.c_char_p(b"engine.cu")
    assert (
        nvrtc.nvrtcCreateProgram(ctypes.byref(program), source.encode(), name, 0, None, None) == 0
    )
    words = [f"--gpu-architecture={arch}".encode(), *(o.encode() for o in (*OPTIONS, *options))]
    code = nvrtc.nvrtcCompileProgram(program, len(words), (ctypes.c_char_p * len(words))(*words))
    nvrtc.nvrtcGetProgramLogSize(program, ctypes.byref(size))
    log = ctypes.create_string_buffer(size.value)
    nvrtc.nvrtcGetProgramLog(program, log)
    assert code == 0, log.value.decode()
    getattr(nvrtc, size_of)(program, ctypes.byref(size))
    image = ctypes.create_string_buffer(size.value)
    getattr(nvrtc, get)(program, image)
    nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
    return image.raw, log.value.decode()


def ptx(source, arch, *options):
    """Compile for a virtual architecture such as ``compute_90``, to text."""
    return _run(source, arch, options, "nvrtcGetPTXSize", "nvrtcGetPTX")[0].rstrip(b"\0").decode()


def compiled(source, arch, kernel, *options):
    """Compile for an architecture such as ``sm_90``; AssertionError with the log where that fails."""
    image, log = _run(
        source, arch, ("--ptxas-options=-v", *options), "nvrtcGetCUBINSize", "nvrtcGetCUBIN"
    )
    said = log.split(f"Compiling entry function '{kernel}'")[1].split("Compiling entry")[0]
    own = re.search(
        r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads", said
    )
    registers = re.search(r"Used (\d+) registers", said)
    assert own and registers, said
    return Compiled(image, int(registers[1]), *map(int, own.groups()))
