"""Files of results: what is read is what was saved, and whatever else a file holds is refused in words."""

import io
import os
import resource
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bounce
import nonsmooth as ns
from nonsmooth.flow.saving import archive
from nonsmooth.model import instruction_form, reversed_system, with_section
from nonsmooth.model.expressions.graph import operation
from nonsmooth.textbook import PROBLEMS
from tests.flow.damaged_files import archive_of, parts_of

x, v, p = (ca.SX.sym(s) for s in "xvp")
ROOT = Path(__file__).parents[2]
BLOCK = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])


def again(system):
    return instruction_form.read_system(instruction_form.written(system))


def memory():
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))


@pytest.mark.parametrize("name", PROBLEMS)
def test_systems_and_runs_of_the_textbook_are_the_same(name, tmp_path):
    problem = PROBLEMS[name]()
    run = problem.run(max_steps=200)
    run.save(tmp_path / "run")
    read = ns.load(tmp_path / "run")
    assert read.system == problem.system and read.system.lifted == problem.system.lifted
    assert np.array_equal(read.x, run.x) and repr(read) == repr(run)
    assert np.array_equal(problem.system.definition.defaults, read.system.definition.defaults)


def bounces():
    turf = dict(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    contact = bounce.contact
    laws = (
        contact.Coulomb(),
        contact.Viscous(viscosity=0.1),
        contact.Dahl(bristle_stiffness=100.0),
        contact.LuGre(
            bristle_stiffness=100.0, bristle_damping=1.0, mu_kinetic=0.2, stribeck_speed=1.0
        ),
    )
    for law in laws:
        yield bounce.KelvinVoigt(**turf, friction=law)
    yield bounce.KelvinVoigt(**turf, load="net", G=1e-4)
    yield bounce.Hertz(mu=0.3, eta=0.5, stiffness=2.0)
    yield bounce.KelvinVoigt(**turf).in_3d()


@pytest.mark.parametrize("model", [*bounces()], ids=lambda m: type(m).__name__)
def test_systems_of_bounces_are_the_same(model):
    assert again(model.system()) == model.system()


def test_sections_reversed_and_regularised_systems_are_the_same():
    relay, y = PROBLEMS["planar_relay"]().system, ca.SX.sym("y")
    for system in (
        ns.FilippovSystem([x, v], field=[v, -9.81], impacts=ns.Impact(x, 0.5, law="moreau")),
        ns.FilippovSystem([x, y, v], field=[v, 0, 0], constraints=ns.Constraint(x + y, name="rod")),
        with_section(BLOCK, x**2 * v, 1),  # a section may have multiple zeros
        reversed_system(relay),
        *(ns.regularise(BLOCK, transition=t) for t in ("tanh", "erf", "algebraic", "arctan")),
        ns.FilippovSystem(
            [x], field=[ca.fabs(p) * x + ca.floor(p) + ca.if_else(p > 0, 1, 2)], parameters=[p]
        ),
    ):
        assert again(system) == system


OPERATIONS = (
    "add sub mul div pow atan2 hypot fmin fmax lt if_else_zero "
    "neg sq twice sqrt exp log sin cos tan tanh erf inv fabs"
).split()


@given(
    st.lists(
        st.tuples(st.sampled_from(OPERATIONS), st.integers(0, 99), st.integers(0, 99)), max_size=40
    )
)
def test_random_graphs_are_the_same(steps):
    """Kinks are in the parameters alone; what is no number, or too simple to be drawn, is left out."""
    smooth, still = [x, v, ca.SX(0.1), p], [p, ca.SX(-1.7), p * p, ca.SX(2)]
    for op, i, j in steps:
        values = still if op in ("fmin", "fmax", "lt", "if_else_zero", "fabs") else smooth
        arity = 2 if op in OPERATIONS[:11] else 1
        made = operation(op, [values[k % len(values)] for k in (i, j)[:arity]])
        values.append(made)
        smooth += [made] if values is still else []
    try:
        system = ns.FilippovSystem(
            [x, v], field=[smooth[-1], smooth[-2] + still[-1] * v], parameters=[p]
        )
    except ns.DefinitionError:
        return
    assert again(system) == system
    assert str(again(system).field("")) == str(system.field(""))


def test_systems_that_are_nested_too_deeply_are_refused(tmp_path):
    deep = x
    for _ in range(instruction_form.DEEPEST):
        deep = ca.sin(deep)
    run = ns.simulate(ns.FilippovSystem([x], field=[deep]), [1.0], 1e-9)
    with pytest.raises(ns.OptionError, match=r"save.*nested"):
        run.save(tmp_path / "run")


def test_calls_of_functions_are_written_out():
    table = ca.Function("table", [v], [v * 2], {"never_inline": True})
    system = ns.FilippovSystem([x], field=[table(x)])
    assert again(system) == system


@pytest.mark.parametrize("path", [None, 3, 1.5, True, [], "", "\0", b"\0", ".", ROOT])
def test_what_is_no_path_of_a_file_is_refused(path):
    with pytest.raises(ns.OptionError, match="path"):
        ns.load(path)
    if not isinstance(path, str | bytes | Path) or path in ("\0", b"\0"):
        with pytest.raises(ns.OptionError, match="path"):
            ns.simulate(BLOCK, [1.0, 0.0], 0.1).save(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes")
def test_pipes_and_devices_are_refused_and_links_are_followed(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(ns.OptionError, match="no regular file"):
            ns.load(path)
    ns.simulate(BLOCK, [1.0, 0.0], 0.1).save(tmp_path / "run")
    (tmp_path / "link").symlink_to(tmp_path / "run")
    assert ns.load(tmp_path / "link").system == BLOCK


def test_a_small_file_cannot_fill_the_memory(tmp_path, monkeypatch):
    """A file that holds a thousand times as much as its size is refused before it is read."""
    monkeypatch.setattr(archive, "_ALWAYS", 1 << 24)
    run = ns.simulate(BLOCK, [1.0, 0.0], 0.1)
    run.save(tmp_path / "run")
    parts = parts_of((tmp_path / "run").read_bytes())
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (1 << 22,)}
    )
    parts["float64.npy"] = header.getvalue() + bytes(1 << 25)
    (tmp_path / "bomb").write_bytes(archive_of(parts))
    assert (tmp_path / "bomb").stat().st_size < 1 << 16
    with pytest.raises(ns.OptionError, match="more than the limit of 16"):
        ns.load(tmp_path / "bomb")


def test_what_is_read_is_what_was_written_however_well_it_is_compressed(monkeypatch):
    monkeypatch.setattr(archive, "_ALWAYS", 1000)
    rows = {"float64": np.zeros(10**6), "int8": np.arange(100, dtype=np.int8)}
    data = archive.packed(b"text", rows)
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        assert {part.compress_type for part in file.infolist()} == {zipfile.ZIP_STORED}
    assert len(data) > 8 * 10**6


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("t", lambda a: np.where(np.arange(len(a)) == 1, np.nan, a)),
        ("t", lambda a: a.astype(int)),
        ("t", lambda a: a[:-1]),
        ("t", lambda a: a[[0, 2, 1, *range(3, len(a))]]),
        ("x", lambda a: a[:, :1]),
        ("x", lambda a: a[None]),
        ("x", list),
        ("status", lambda a: 3),
        ("system", lambda a: None),
        ("message", lambda a: 3),
        ("parameters", lambda a: {"a": "b"}),
        ("parameters", lambda a: {"a": np.inf}),
        ("events", lambda a: a.labels),
        ("events", lambda a: replace(a, t=a.t[1:])),
        ("events", lambda a: replace(a, t=a.t * np.nan)),
        ("events", lambda a: replace(a, states=a.states[:, :1])),
        ("events", lambda a: replace(a, states=a.states + np.inf)),
        ("events", lambda a: replace(a, rows=a.rows + len(a.states))),
        ("events", lambda a: replace(a, rows=-1 - a.rows)),
        ("events", lambda a: replace(a, rows=a.rows.astype(np.int32))),
        ("events", lambda a: replace(a, jumps=~a.jumps)),
        ("events", lambda a: replace(a, codes=a.codes + 9)),
        ("events", lambda a: replace(a, codes=a.codes - 9)),
        ("events", lambda a: replace(a, labels=("h0",) * len(a.labels))),
        ("events", lambda a: replace(a, motions=np.zeros((99, 3)))),
        ("events", lambda a: replace(a, motions=a.motions.astype(int))),
        ("sample", lambda a: np.zeros(2)),
        ("segments", lambda a: a.modes),
        ("segments", lambda a: replace(a, last=a.last + 99)),
        ("segments", lambda a: replace(a, first=a.first - 1)),
        ("segments", lambda a: replace(a, t_end=a.t_end[:-1])),
        ("segments", lambda a: replace(a, codes=a.codes + 9)),
        ("segments", lambda a: replace(a, modes=())),
        ("dense", lambda a: 1),
        ("steps", lambda a: type(a)(a.starts[1:], a.coefficients)),
        ("steps", lambda a: type(a)(a.starts, [c[:1] for c in a.coefficients])),
    ],
)
def test_runs_that_no_run_returned_are_refused(name, change, tmp_path):
    run = ns.simulate(BLOCK, [1.0, 0.0], 2.0, t_eval=[0.0, 1.0, 2.0])
    field = "sample_t" if name == "sample" else name
    replace(run, **{field: change(getattr(run, field))}).save(tmp_path / "run")
    with pytest.raises(ns.OptionError, match=name):
        ns.load(tmp_path / "run")


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("itinerary_code", lambda a: a + 9),
        ("itinerary_code", lambda a: a - 9),
        ("status", lambda a: a + 100),
        ("status", lambda a: a.astype(float)),
        ("x", lambda a: a[..., 0]),
        ("t", lambda a: a[:1]),
        ("itineraries", list),
        ("state_names", lambda a: (1, 2)),
    ],
)
def test_ensembles_that_no_sweep_returned_are_refused(name, change, tmp_path):
    found = ns.ensemble(BLOCK, np.array([[1.0, 0.0], [np.nan, 1.0]]), 2.0)
    replace(found, **{name: change(getattr(found, name))}).save(tmp_path / "found")
    with pytest.raises(ns.OptionError, match=name):
        ns.load(tmp_path / "found")


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("program", ["flow.damaged_files", "proofs.damaged_proofs"])
def test_damaged_files_are_refused_in_words(program, count):
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-m", f"tests.{program}", str(count)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=memory,
    )
    assert done.returncode == 0 and f"{count} " in done.stdout, done.stdout + done.stderr
