"""The driver's library: of a wheel or of the cache, with the same bits, built without any installed package."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import hatch_build
import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler, interpreter, library
from nonsmooth.flow.engine.building.core_source import core_source, source_key
from nonsmooth.flow.engine.interpreter import interpreter_for
from nonsmooth.flow.options import Options

ROOT = Path(hatch_build.__file__).parent
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def test_a_build_needs_nothing_but_python():
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); import hatch_build, pathlib; "
        f"print(hatch_build.building(pathlib.Path({str(ROOT)!r}))[0].source_key()); "
        "print([n for n in sys.modules if n.startswith(('casadi', 'numpy', 'nonsmooth'))])"
    )
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True)
    assert done.stdout.split("\n")[:2] == [source_key(), "[]"], done.stderr


@pytest.mark.slow
@needs_compiler
def test_the_library_of_a_wheel_needs_no_compiler_and_has_the_bits_of_the_cache(monkeypatch):
    hook, data = SimpleNamespace(root=str(ROOT)), {"force_include": {}}
    hatch_build.CustomBuildHook.initialize(hook, "standard", data)
    ((built, place),) = data["force_include"].items()
    assert data["tag"].startswith("py3-none-") and not data["pure_python"]
    assert Path(place).parent == Path(library.__file__).parent.relative_to(ROOT)
    monkeypatch.setattr(library, "_PACKAGED", Path(built))
    monkeypatch.setattr(library, "build", lambda source: pytest.fail("a compiler was run"))
    wheel = interpreter.declare(library.core_library())
    problem = ns.textbook.by_name("leine_stick_slip")
    options, p = Options(t_end=30.0), problem.system.parameter_vector(problem.parameters)
    run = lambda: interpreter_for(problem.system, options).run(np.array(problem.start), p, options)
    ours = run()
    monkeypatch.setattr(interpreter, "library", lambda: wheel)
    theirs = run()
    assert ours.x.tobytes() == theirs.x.tobytes() and ours.t.tobytes() == theirs.t.tobytes()
    hatch_build.CustomBuildHook.finalize(hook, "standard", data, "")
    assert not Path(built).exists()


@pytest.mark.slow
@needs_compiler
def test_the_processor_does_not_change_the_bits(monkeypatch):
    monkeypatch.setattr(
        library, "build", lambda source, build=library.build: build(source, ["-march=native"])
    )
    monkeypatch.setattr(library, "_PACKAGED", Path("none"))
    native = interpreter.declare(library.core_library())
    problem = ns.textbook.by_name("kelvin_voigt_bounce")
    options, p = Options(t_end=problem.t_end), problem.system.parameter_vector(problem.parameters)
    run = lambda: interpreter_for(problem.system, options).run(np.array(problem.start), p, options)
    ours = run()
    monkeypatch.setattr(interpreter, "library", lambda: native)
    assert ours.x.tobytes() == run().x.tobytes()


@needs_compiler
def test_a_library_of_other_sources_is_not_loaded(monkeypatch, tmp_path):
    other = tmp_path / "other.so"
    other.write_bytes(b"no library")
    monkeypatch.setattr(library, "_PACKAGED", other)
    built = []
    monkeypatch.setattr(library, "build", lambda source: built.append(source))
    library.core_library()
    assert built == [core_source()]
