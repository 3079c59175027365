"""The driver as WebAssembly: ``make wasm`` compiles the text of runs for pages in a browser.

The module imports nothing: the compiler's C library for WASI provides the functions of libm and malloc.
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from .core_source import keyed, run_source

#: The module in the package.
MODULE = Path(__file__).parents[1] / "core.wasm"

#: Functions that pages call.
_EXPORTS = """
    table_new table_modes table_size table_free table_read
    run_new run_free run_begin run_continue run_read run_resume run_many run_sample malloc free calloc
""".split()

#: As ``compilers.FLAGS``, smaller: no reassociation and no fused products, so that a page has the bits of Python.
_FLAGS = (
    "-target wasm32-wasi -mexec-model=reactor -std=gnu11 -Os -fno-math-errno -fno-trapping-math "
    "-ffp-contract=off -w -Wl,--strip-all -Wl,--gc-sections -Wl,--export=nonsmooth_key"
).split()

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


def key_of(source: str) -> str:
    """Identify a text without its comments and spaces, with the functions that are exported and the flags."""
    text = "".join(_COMMENT.sub("", source).split())
    return hashlib.sha256(" ".join([text, *_EXPORTS, *_FLAGS]).encode()).hexdigest()[:32]


def module_key() -> str:
    """Identify the module of the present text of runs."""
    return key_of(run_source())


def has_module_key(module: bytes) -> bool:
    """Whether a module was compiled from the present text."""
    return module_key().encode() in module


def compile_module() -> bytes:
    """Compile the module with ziglang (the extra ``compiler``)."""
    with tempfile.TemporaryDirectory() as folder:
        text, module = Path(folder, "core.c"), Path(folder, "core.wasm")
        text.write_text(keyed(run_source(), module_key()), encoding="utf-8")
        exports = [f"-Wl,--export={name}" for name in _EXPORTS]
        zig = (sys.executable, "-m", "ziglang", "cc")
        subprocess.run([*zig, *_FLAGS, *exports, str(text), "-o", str(module)], check=True)
        return module.read_bytes()


if __name__ == "__main__":
    MODULE.write_bytes(compile_module())
    print(f"wrote {MODULE.name}, {MODULE.stat().st_size} bytes")
