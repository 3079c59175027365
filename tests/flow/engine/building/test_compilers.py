"""A compiler that fails gives one warning, and the next one is used; without another one that is an error."""

import importlib.util
import os
import platform
import shutil
import signal
import stat
import subprocess
import sys
import textwrap

import pytest

from nonsmooth.flow.engine.building import build as build_module
from nonsmooth.flow.engine.building import compilers as compilers_module
from nonsmooth.flow.engine.building.build import CompilerError, build, find_compiler
from nonsmooth.flow.engine.building.compilers import compilers
from nonsmooth.flow.warn import CompilerWarning, warn_once

SOURCE = "int answer(void) { return 42; }\n"

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    warn_once.cache_clear()
    monkeypatch.setenv("NONSMOOTH_CACHE", str(tmp_path / "cache"))


def program(path, text):
    path.write_text(textwrap.dedent(text))
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


#: What takes the place of a compiler, and what is said of it.
STUBS = {
    "developer tools": (
        "#!/bin/sh\necho 'xcode-select: note: no developer tools were found' >&2\nexit 1\n",
        "no developer tools were found",
    ),
    "silent": ("#!/bin/sh\nexit 69\n", "exit status 69"),
    "does nothing": ("#!/bin/sh\nexit 0\n", "no library"),
    "writes no library": (
        '#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\necho no >"$2"\n',
        "does not load",
    ),
    "no program": ("\x7fELF is not enough", ""),
    "killed": ("#!/bin/sh\nkill -9 $$\n", "exit status -9"),
    "no text": ("#!/bin/sh\nprintf '\\377\\376' >&2\nexit 1\n", "failed"),
}


@pytest.fixture
def stub(request, tmp_path, monkeypatch):
    """A folder that is the whole PATH, with the stub as cc and the tools that the stubs need."""
    folder = tmp_path / "bin"
    folder.mkdir()
    program(folder / "cc", STUBS[request.param][0])
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(folder))
    return folder, STUBS[request.param][1]


@pytest.mark.parametrize("stub", STUBS, indirect=True)
def test_the_next_compiler_is_used(stub, monkeypatch):
    real = shutil.which("cc", path=os.defpath + ":/usr/local/bin") or shutil.which("gcc")
    program(stub[0] / "gcc", f'#!/bin/sh\nPATH=/usr/local/bin:/usr/bin:/bin exec {real} "$@"\n')
    assert [os.path.basename(c[0]) for c in compilers()[:2]] == ["cc", "gcc"]
    with pytest.warns(CompilerWarning, match="(?s)compiler.*cc") as reported:
        assert build(SOURCE).answer() == 42
        assert build(SOURCE.replace("42", "43")).answer() == 43
    assert len(reported) == 1 and stub[1] in str(reported[0].message)


RUN = """
import sys
sys.modules["ziglang"] = None  # a wheel of it may be installed
import importlib.util as u
f = u.find_spec
u.find_spec = lambda n, *a: None if n == "ziglang" else f(n, *a)
import casadi as ca, nonsmooth as ns
said = []
x, v = ca.SX.sym("x"), ca.SX.sym("v")
system = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 1], below=[v, -x + 1])
for work in (lambda: ns.simulate(system, [1.0, 0.0], 1.0), lambda: ns.ensemble(system, [[1.0, 0.0]] * 70, 1.0)):
    try:
        work()
    except ns.NonsmoothError as error:
        assert type(error).__name__ == "CompilerError", error
        said.append(str(error))
    else:
        raise AssertionError("no warning of a compiler that fails")
print(said[0])
"""


def run_alone(**environment):
    """What the program prints in a process of its own, where it does not end in an error."""
    own = {k: v for k, v in os.environ.items() if k != "CC"} | environment
    path = os.pathsep.join(p for p in sys.path if p)
    done = subprocess.run(
        [sys.executable, "-c", RUN], env=own | {"PYTHONPATH": path}, capture_output=True, text=True
    )
    reported = [k for k in done.stderr.splitlines() if not k.startswith("nonsmooth: compiling")]
    assert done.returncode == 0 and reported == [], done.stderr
    return done.stdout


def test_without_any_compiler_a_run_says_what_to_install(tmp_path):
    assert "pip install ziglang" in run_alone(PATH=str(tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize(
    "stub", ["writes no library", "developer tools", "no program"], indirect=True
)
def test_without_another_compiler_a_run_says_what_to_install(stub, tmp_path):
    said = run_alone()
    assert stub[1] in said and "pip install ziglang" in said
    assert str(stub[0] / "cc") in said  # which one is at fault
    assert list((tmp_path / "cache").glob("*.so")) == []


@pytest.mark.parametrize("cc", [" ", "\t", "gcc 'x", 'gcc "', "''", "gcc \\"])
def test_a_malformed_cc_is_reported(cc, monkeypatch):
    monkeypatch.setenv("CC", cc)
    with pytest.raises(CompilerError, match=r"\bCC\b"):
        build(SOURCE)


@pytest.mark.parametrize("cc", ["", "/no/such/compiler", "-O2", "/"])
def test_a_cc_that_names_no_program_leaves_the_others(cc, monkeypatch):
    monkeypatch.setenv("CC", cc)
    assert build(SOURCE).answer() == 42


@pytest.mark.parametrize(("quiet", "said"), [(0.0, True), (1e6, False)])
def test_a_long_compilation_says_so_on_stderr(quiet, said, monkeypatch, capfd):
    monkeypatch.setattr(build_module, "_QUIET", quiet)
    assert build(SOURCE).answer() == 42
    out, err = capfd.readouterr()
    assert out == "" and ("compiling" in err and "done" in err) == said and bool(err) == said
    assert (f"with {find_compiler()[0]} (" in err) == said  # if it hangs, that is the one
    assert build(SOURCE).answer() == 42  # it is kept
    assert capfd.readouterr() == ("", "")


def test_a_compilation_without_stderr(monkeypatch):
    monkeypatch.setattr(build_module, "_QUIET", 0.0)
    monkeypatch.setattr(sys, "stderr", None)
    assert build(SOURCE).answer() == 42


def test_an_interrupt_ends_the_compiler_and_leaves_nothing(monkeypatch, tmp_path):
    started = []
    real = subprocess.Popen

    class Interrupted(real):
        def poll(self):
            if self not in started:
                started.append(self)
                raise KeyboardInterrupt
            return super().poll()

    monkeypatch.setattr(subprocess, "Popen", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        build(SOURCE)
    assert started[0].returncode is not None
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_compiler_without_an_end_is_ended_with_all_it_started(monkeypatch, tmp_path):
    """It is waited for once; then the next one does the work."""
    started, ended, real, sound = [], [], subprocess.Popen, find_compiler()
    hanging, kill = program(tmp_path / "hanging", "#!/bin/sh\nsleep 600 &\nwait\n"), os.killpg

    class Seen(real):
        def __init__(self, command, **options):
            super().__init__(command, **options)
            started.append((command[0], self.pid))

    monkeypatch.setattr(subprocess, "Popen", Seen)
    monkeypatch.setattr(os, "killpg", lambda *group: (ended.append(group), kill(*group)))
    monkeypatch.setattr(build_module, "_QUIET", 0.05)
    monkeypatch.setattr(build_module, "_LONGEST", 0.5)
    monkeypatch.setattr(build_module, "_HANGING", set())
    monkeypatch.setattr(build_module, "compilers", lambda: ((str(hanging),),))
    for _ in range(2):
        with pytest.raises(CompilerError, match=r"compiler[\s\S]*0\.5 s"):
            build(SOURCE)
    assert len(started) == 1
    assert ended == [(started[0][1], signal.SIGKILL)]
    monkeypatch.setattr(build_module, "compilers", lambda: ((str(hanging),), sound))
    monkeypatch.setattr(build_module, "_LONGEST", 600.0)
    with pytest.warns(CompilerWarning, match="compiler.*hanging"):
        assert build(SOURCE).answer() == 42
    assert [command for command, _ in started] == [str(hanging), sound[0]]


def test_a_full_disk_is_reported(monkeypatch):
    def full(path, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(build_module.files, "replace", full)
    with pytest.raises(CompilerError, match="No space left"):
        build(SOURCE)


def test_the_wheel_of_zig_is_the_last_compiler_and_known_by_its_file(monkeypatch, tmp_path):
    wheel = tmp_path / "ziglang" / "__init__.py"
    wheel.parent.mkdir()
    wheel.write_text("")
    real = importlib.util.find_spec

    def found(name, *args):
        spec = importlib.util.spec_from_file_location("ziglang", wheel)
        return spec if name == "ziglang" else real(name, *args)

    monkeypatch.setattr(compilers_module.importlib.util, "find_spec", found)
    compilers_module._located.cache_clear()
    compilers_module.version.cache_clear()
    last = compilers()[-1]
    before = compilers_module.version(last)
    assert last == (sys.executable, "-m", "ziglang", "cc")
    assert str(wheel) in before
    wheel.write_text("__version__ = '2'\n")
    compilers_module.version.cache_clear()
    assert compilers_module.version(last) != before
    compilers_module._located.cache_clear()
    compilers_module.version.cache_clear()


def test_a_compiler_or_processor_of_which_nothing_is_known_still_has_a_name(monkeypatch):
    assert compilers_module.version(("/nowhere/cc",)) == "/nowhere/cc"

    def unreadable(self, **options):
        raise OSError(2, "No such file")

    compilers_module.processor.cache_clear()
    monkeypatch.setattr(compilers_module.Path, "read_text", unreadable)
    name = compilers_module.processor()
    compilers_module.processor.cache_clear()
    assert name.split()[0] == platform.machine()
