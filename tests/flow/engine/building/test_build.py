"""A library is built once, safely, again when damaged, and a failure shows command and file."""

import ctypes
import multiprocessing
import os
import subprocess
import weakref

import pytest

import nonsmooth.flow.engine.building.build as build_module
from nonsmooth.flow.engine.building.build import CompilerError, build, find_compiler
from nonsmooth.flow.warn import CompilerWarning, warn_once

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

SOURCE = "int answer(void) { return 42; }\n"


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NONSMOOTH_CACHE", str(tmp_path / "cache"))
    warn_once.cache_clear()
    return tmp_path / "cache"


def test_compiled_once(cache, monkeypatch):
    assert build(SOURCE).answer() == 42
    entries = list(cache.iterdir())
    assert [e.suffix for e in entries] == [".so"]
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: pytest.fail("compiled again"))
    assert build(SOURCE).answer() == 42


def test_what_killed_processes_left_is_removed(cache):
    cache.mkdir(mode=0o700)
    for name in ("build-old", "build-new"):
        (cache / name).mkdir()
        (cache / name / "engine.c").write_text(SOURCE)
    for name in (".part-old", ".part-new", "other"):
        (cache / name).write_text("")
    for name in ("build-old", ".part-old", "other"):
        os.utime(cache / name, (0.0, 0.0))
    (cache / "build-link").symlink_to(cache / "build-new")
    os.utime(cache / "build-link", (0.0, 0.0), follow_symlinks=False)
    assert build(SOURCE).answer() == 42
    left = {path.name for path in cache.iterdir() if path.suffix != ".so"}
    assert left - {"build-link"} == {"build-new", ".part-new", "other"}
    assert (cache / "build-new" / "engine.c").exists()


def test_a_folder_of_work_stays_until_the_compiler_ends(cache, monkeypatch):
    """Also where the program ends: what tempfile removes then is not it."""
    before, during = set(weakref.finalize._registry), []

    def call(command):
        during.append(set(weakref.finalize._registry))
        return "failed"

    monkeypatch.setattr(build_module, "_call", call)
    with pytest.raises(CompilerError):
        build(SOURCE)
    assert during and all(found <= before for found in during)
    assert not list(cache.glob("build-*"))


def test_key_depends_on_source_flags_compiler_and_processor(monkeypatch):
    command = find_compiler()
    key = build_module.library_key(SOURCE, command)
    assert build_module.library_key(SOURCE + " ", command) != key
    assert build_module.library_key(SOURCE, ("/bin/sh",)) != key
    monkeypatch.setattr(build_module, "FLAGS", ["-O0"])
    other = build_module.library_key(SOURCE, command)
    assert other != key
    monkeypatch.setattr(build_module, "processor", lambda: "another")
    assert build_module.library_key(SOURCE, command) != other


@pytest.mark.parametrize("damage", [b"", b"\x7fELF garbage", None])
def test_damaged_entry_is_rebuilt(cache, damage):
    source = f"int answer(void) {{ return {len(damage or b'xyz')}; }}\n"
    library = cache / f"{build_module.library_key(source, find_compiler())}.so"
    cache.mkdir(mode=0o700)
    if damage is None:  # cut off in the middle, as by a full disk
        build_module.compile_library(source, find_compiler(), library)
        damage = library.read_bytes()[:-100]
        library.unlink()
    library.write_bytes(damage)
    assert build(source).answer() >= 0
    assert library.read_bytes() != damage


def _build_and_call(number):
    return build(f"int answer(void) {{ return {number}; }}\n").answer()


@pytest.mark.slow
def test_many_processes_at_once(cache):
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        assert pool.map(_build_and_call, [7] * 8) == [7] * 8
    assert len(list(cache.iterdir())) == 1


def test_compiler_failure_shows_command_and_file(cache):
    with pytest.raises(CompilerError) as error:
        build("int broken( { }\n")
    text = str(error.value)
    kept = text.split("kept in ")[1].split(". ")[0]
    assert os.path.exists(kept) and "engine.c" in text and find_compiler()[0] in text
    assert "expected" in text.lower()


def test_named_compiler_is_preferred(cache, monkeypatch):
    monkeypatch.setenv("CC", find_compiler()[0] + " -DEXTRA=1")
    assert find_compiler()[1:] == ("-DEXTRA=1",)
    assert build("int answer(void) { return EXTRA; }\n").answer() == 1


def test_cache_folder_that_cannot_be_written(tmp_path, monkeypatch):
    warn_once.cache_clear()
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("NONSMOOTH_CACHE", str(blocked))
    with pytest.warns(CompilerWarning, match="cache"):
        assert isinstance(build(SOURCE), ctypes.CDLL)
