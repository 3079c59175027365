"""Results survive files, pickles and copies to the last bit."""

import copy
import pickle

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v, a = (ca.SX.sym(s) for s in ("x", "v", "a"))
BLOCK = ns.FilippovSystem.from_expression(
    [x, v],
    [v, -x - a * ca.sign(v - 0.3)],
    parameters={a: 0.4},
    stops=ns.Stop(x - 5, name="wall"),
    resets=ns.Reset(x + 1, [x, -v], -1, "bumper"),
)
PLANE = ns.FilippovSystem([x, v], surface=v, above=[x, v - 1 + x], below=[-2, 1 + x])


def run():
    return ns.simulate(BLOCK, [0.0, -2.0], 12.0, t_eval=[0.0, 1.0, 12.0])


def many():
    starts = np.array([[0.0, -2.0], [0.5, 0.5], [np.nan, 0.0], [4.9, 1.0]]).reshape(2, 2, 2)
    return ns.ensemble(BLOCK, starts, 6.0, at=ns.Section("entry", count=2))


MADE = {"Trajectory": run, "Ensemble": many}


def same(one, other):
    """Whether two values are equal to the last bit, NaN included, through all their parts."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(
            one, other, equal_nan=one.dtype.kind == "f"
        )
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict):
        return list(one) == list(other) and all(map(same, one.values(), other.values()))
    if hasattr(one, "__dataclass_fields__"):
        return all(same(getattr(one, f), getattr(other, f)) for f in one.__dataclass_fields__)
    return one == other


@pytest.mark.parametrize("kind", MADE)
def test_a_saved_result_is_the_same(kind, tmp_path):
    result = MADE[kind]()
    result.save(tmp_path / "result")  # the name is kept as it is
    for again in (ns.load(tmp_path / "result"), type(result).load(str(tmp_path / "result"))):
        assert type(again).__name__ == kind and same(again, result)


@pytest.mark.parametrize("kind", MADE)
@pytest.mark.parametrize("copied", [lambda r: pickle.loads(pickle.dumps(r)), copy.deepcopy])
def test_a_copied_result_is_the_same(kind, copied):
    assert same(copied(MADE[kind]()), MADE[kind]())


def test_a_loaded_run_still_computes(tmp_path):
    result = run()
    result.save(tmp_path / "run.npz")
    again = ns.load(tmp_path / "run.npz")
    assert np.array_equal(again(np.linspace(0, 12, 50)), result(np.linspace(0, 12, 50)))
    assert again.system == result.system and str(again.system.lifted[0]) == str(BLOCK.lifted[0])
    assert np.array_equal(ns.simulate(again.system, [0.0, -2.0], 12.0).x, result.x)


def test_files_that_are_none_are_refused(tmp_path):
    (tmp_path / "text").write_text("no archive")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with open(tmp_path / "pickled", "wb") as file:
        np.savez(file, tree=np.array([{}], dtype=object))
    run().save(tmp_path / "cut")
    (tmp_path / "cut").write_bytes((tmp_path / "cut").read_bytes()[:-200])
    for name in ("missing", "text", "other.npz", "pickled", "cut"):
        with pytest.raises(ns.OptionError, match=r"^path"):
            ns.load(tmp_path / name)
    run().save(tmp_path / "run")
    with pytest.raises(ns.OptionError, match=r"^path .*Trajectory"):
        ns.Ensemble.load(tmp_path / "run")
    with pytest.raises(ns.OptionError, match=r"^path"):
        run().save(tmp_path / "no folder" / "run")


def test_a_file_of_another_format_and_what_is_no_result_are_refused(tmp_path):
    from nonsmooth.flow import saving

    path = tmp_path / "run.npz"
    run().save(path)
    with np.load(path) as data:
        arrays = {name: data[name] for name in data.files}
    head = arrays["tree"].tobytes().replace(b'"format": ', b'"format": 9')
    assert head != arrays["tree"].tobytes()
    np.savez(path, **{**arrays, "tree": np.frombuffer(head, np.uint8)})
    with pytest.raises(ns.OptionError, match=r"^path .*format 9"):
        ns.load(path)
    with pytest.raises(ns.OptionError, match=r"^save .*<object"):
        saving._packed(object())
    with pytest.raises(ns.OptionError, match=r"^save .*<U1"):
        saving._packed([np.array(["a"])])


def test_one_system_of_two_results_is_written_once():
    from nonsmooth.flow import saving

    once, twice = len(saving._packed([BLOCK])), len(saving._packed([BLOCK, BLOCK]))
    assert twice < 1.1 * once
