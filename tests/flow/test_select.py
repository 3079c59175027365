"""The engine is chosen by the system and the compiler alone; what cannot be had is told once."""

import warnings

import casadi as ca
import pytest

import nonsmooth as ns
from nonsmooth.flow import select
from nonsmooth.flow.compiled.building.compilers import CompilerError
from nonsmooth.flow.warn import CompilerWarning, warn_once


@pytest.fixture(autouse=True)
def once_again():
    warn_once.cache_clear()


def test_the_reference_is_never_compiled(monkeypatch):
    monkeypatch.setattr(select, "find_compiler", lambda: pytest.fail("a compiler was looked for"))
    assert not select.use_compiled("reference")
    assert not select.use_compiled("auto", supported=False)


def test_another_word_and_a_system_without_an_engine_are_refused():
    x = ca.SX.sym("x")
    system = ns.FilippovSystem([x], surface=x, above=[-1], below=[1])
    with pytest.raises(ns.OptionError, match=r"^engine .*'fast'"):
        ns.simulate(system, [1.0], 1.0, engine="fast")
    with pytest.raises(ns.OptionError, match=r"^engine .*'compiled'"):
        select.use_compiled("compiled", supported=False)


def test_without_a_compiler_auto_warns_once_and_compiled_raises(monkeypatch):
    monkeypatch.setattr(select, "find_compiler", lambda: None)
    with pytest.warns(CompilerWarning, match="C compiler.*reference driver"):
        assert not select.use_compiled("auto")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not select.use_compiled("auto")
    with pytest.raises(CompilerError, match="No C compiler"):
        select.use_compiled("compiled")


def test_a_cc_that_is_no_command_warns_or_raises(monkeypatch):
    def named():
        raise CompilerError("CC: expected a command")

    monkeypatch.setattr(select, "find_compiler", named)
    with pytest.warns(CompilerWarning, match="CC.*reference driver"):
        assert not select.use_compiled("auto")
    with pytest.raises(CompilerError, match="CC"):
        select.use_compiled("compiled")


def test_what_failed_to_compile_is_not_tried_again_unless_asked_for_by_name():
    tried: list[int] = []
    of = type("Model", (), {})()

    def work():
        tried.append(1)
        raise CompilerError("compiler: it failed, see /tmp/x.c", brief="The compiler fails.")

    with pytest.warns(CompilerWarning, match="^The compiler fails.*reference driver"):
        assert select.compiled_or_none("auto", of, work) is None
    assert select.compiled_or_none("auto", of, work) is None
    assert len(tried) == 1
    with pytest.raises(CompilerError, match=r"/tmp/x\.c"):
        select.compiled_or_none("compiled", of, work)
    assert len(tried) == 2
