"""A checkpoint that is damaged, changed or another's is refused or computed again, never believed."""

import io
import json
import os
import shutil
import zipfile

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.ensembles import checkpoint
from nonsmooth.flow.ensembles.checkpoint import Checkpoint

CHUNK, COUNT = 4, 10
STARTS = np.random.default_rng(5).normal(size=(COUNT, 2))
LAST = "chunk-00000002.npz"  # of two trajectories only


def friction(load=0.4):
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    return ns.FilippovSystem([x, v], surface=v, above=[v, -x - load], below=[v, -x + load])


SYSTEM = friction()


def sweep(folder, **options):
    work = ns.Work(checkpoint=folder, threads=1, **{"chunk": CHUNK, **options})
    return ns.ensemble(SYSTEM, STARTS, 6.0, at_event=("entry", 1), engine="reference", work=work)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole") / "sweep"
    return folder, sweep(folder)


@pytest.fixture
def folder(whole, tmp_path):
    return shutil.copytree(whole[0], tmp_path / "sweep")


def assert_same(many, expected):
    for name in ("x", "t", "status", "itinerary_code", "event_x", "event_t"):
        assert getattr(many, name).tobytes() == getattr(expected, name).tobytes(), name
    assert many.itineraries == expected.itineraries
    assert all(np.array_equal(many.events[k], expected.events[k]) for k in expected.events)


@pytest.fixture
def saved(monkeypatch):
    """Numbers of the chunks that are written."""
    numbers, original = [], Checkpoint.save
    monkeypatch.setattr(Checkpoint, "save", lambda s, k, c: (numbers.append(k), original(s, k, c)))
    return numbers


def test_a_whole_checkpoint_is_read_and_nothing_is_computed(folder, whole, saved):
    assert_same(sweep(folder, chunk=3), whole[1])  # the folder knows its size of a chunk
    assert saved == []


# what is in a chunk's file


def rewritten(change):
    """Damage: the arrays of the file changed by a function and written again."""

    def damage(path):
        with np.load(path) as data:
            arrays = dict(data)
        arrays = change(arrays) or arrays
        np.savez(path, **arrays)

    return damage


def put(name, value):
    def change(arrays):
        arrays[name] = np.array(value)

    return rewritten(change)


def scaled(arrays):
    arrays["x"] = arrays["x"] * (1 + 1e-15)


def cast(name, dtype):
    return rewritten(lambda arrays: {**arrays, name: arrays[name].astype(dtype)})


def without(name):
    return rewritten(lambda arrays: {k: v for k, v in arrays.items() if k != name})


def claims_to_be_huge(path):
    """An array whose header promises 10^12 numbers."""
    parts = {}
    with zipfile.ZipFile(path) as file:
        for name in file.namelist():
            parts[name] = file.read(name)
    header = io.BytesIO()
    promise = {"descr": "<f8", "fortran_order": False, "shape": (10**12, 2)}
    np.lib.format.write_array_header_1_0(header, promise)
    parts["x.npy"] = header.getvalue()
    with zipfile.ZipFile(path, "w") as file:
        for name, data in parts.items():
            file.writestr(name, data)


def compressed_bomb(path):
    with np.load(path) as data:
        arrays = dict(data)
    arrays["words"] = np.zeros(1 << 24, np.uint8)
    np.savez_compressed(path, **arrays)


def cut(part):
    return lambda path: path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])


def flipped(place):
    def damage(path):
        data = bytearray(path.read_bytes())
        data[int(place * len(data))] ^= 1
        path.write_bytes(bytes(data))

    return damage


def from_another_place(path):
    shutil.copy(path.with_name("chunk-00000000.npz"), path)


def a_pipe(path):
    path.unlink()
    os.mkfifo(path)


def a_link_round(path):
    path.unlink()
    path.symlink_to(path)


def pickled(path):
    np.savez(path, x=np.array([{"a": 1}], dtype=object))


DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("cut off"),
    **{f"cut at {p}": cut(p) for p in (0.1, 0.5, 0.9, 0.999)},
    "one bit of a state": rewritten(scaled),
    "shape": put("x", np.zeros((3, 2))),
    "one state too many": put("x", np.zeros((2, 3))),
    "transposed": rewritten(lambda a: {**a, "x": np.asfortranarray(a["x"])}),
    "status that is none": put("status", np.array([77, 0], np.int8)),
    "status of another": put("status", np.array([1, 1], np.int8)),
    "itinerary that is none": put("itinerary", np.array([99, 0], np.int32)),
    "negative itinerary": put("itinerary", np.array([-1, 0], np.int32)),
    "negative events": rewritten(lambda a: {**a, "kinds": -a["kinds"] - 1}),
    "type": cast("x", "float32"),
    "bytes in another order": cast("x", ">f8"),
    "words of no text": put("words", np.frombuffer(b"[1, 2]", np.uint8)),
    "words without end": put("words", np.frombuffer(b"[" * 100_000, np.uint8)),
    "no words": without("words"),
    "no times": without("t"),
    "no seal": without("seal"),
    "no event asked for": without("at_x"),
    "huge": claims_to_be_huge,
    "bomb": compressed_bomb,
    "another's place": from_another_place,
    "gone": lambda path: path.unlink(),
    "pipe": a_pipe,
    "link to itself": a_link_round,
    "pickle": pickled,
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_chunk_is_computed_again(kind, folder, whole, saved):
    DAMAGE[kind](folder / LAST)
    assert_same(sweep(folder), whole[1])
    assert saved == [2]
    assert_same(sweep(folder), whole[1])
    assert saved == [2]


@pytest.mark.parametrize("place", np.linspace(0, 0.9999, 25).round(4))
def test_a_single_bit_changes_nothing(place, folder, whole, saved):
    """It is found, unless it is in what means nothing, such as the time in the zip file."""
    flipped(place)(folder / LAST)
    assert_same(sweep(folder), whole[1])
    assert saved in ([], [2])


def test_a_chunk_of_another_problem_is_computed_again(folder, whole, saved, tmp_path):
    other = tmp_path / "other"
    work = ns.Work(checkpoint=other, threads=1, chunk=CHUNK)
    options = {"at_event": ("entry", 1), "engine": "reference", "work": work}
    ns.ensemble(friction(0.3), STARTS, 6.0, **options)
    shutil.copy(other / LAST, folder / LAST)
    saved.clear()
    assert_same(sweep(folder), whole[1])
    assert saved == [2]


def test_a_link_in_the_place_of_a_chunk_is_replaced_not_followed(folder, whole, tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (folder / LAST).unlink()
    (folder / LAST).symlink_to(victim)
    assert_same(sweep(folder), whole[1])
    assert victim.read_text() == "precious" and not (folder / LAST).is_symlink()


# what is in the file of the problem


def edited(**changes):
    def damage(path):
        path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))

    return damage


def sealed_anew(chunk):
    def damage(path):
        own = {k: v for k, v in json.loads(path.read_text()).items() if k != "seal"} | {
            "chunk": chunk
        }
        path.write_text(json.dumps(checkpoint._sealed(own)))

    return damage


HEADS = {
    "sealed": sealed_anew(10**40),
    "sealed too": sealed_anew(0),
    **{
        f"chunk {c!r}"[:20]: edited(chunk=c)
        for c in (0, -5, 3, 49, 10**9, 10**400, True, 4.0, "4", None, [4])
    },
    "empty": lambda path: path.write_text(""),
    "number": lambda path: path.write_text("3"),
    "list": lambda path: path.write_text("[]"),
    "deep": lambda path: path.write_text("[" * 4000),
    "long": lambda path: path.write_text("[" * 100_000),
    "no text": lambda path: path.write_bytes(b"\xff\xfe\x00"),
    "cut": cut(0.5),
    "pipe": a_pipe,
    "link to itself": a_link_round,
    "seal": edited(seal="0" * 64),
}


@pytest.mark.parametrize("kind", HEADS)
def test_a_damaged_problem_is_refused(kind, folder):
    HEADS[kind](folder / "problem.json")
    with pytest.raises(ns.OptionError, match="checkpoint"):
        sweep(folder)


@pytest.mark.parametrize("version", [1, 2, 99])
def test_another_version_is_refused(version, folder):
    edited(format=version)(folder / "problem.json")
    with pytest.raises(ns.OptionError, match="version"):
        sweep(folder)


# the folder


def test_a_folder_with_nothing_but_a_file_under_way_is_used(tmp_path, whole):
    """A process that is killed while it writes the first file leaves only that."""
    (tmp_path / ".part-abc").write_bytes(b"half")
    assert_same(sweep(tmp_path), whole[1])


def test_a_chunk_that_cannot_be_written_is_told_and_the_others_are_kept(tmp_path, whole):
    folder = tmp_path / "sweep"
    sweep(folder)
    (folder / LAST).unlink()
    (folder / LAST).mkdir()
    (folder / LAST / "in the way").write_text("")
    with pytest.raises(ns.OptionError, match="checkpoint"):
        sweep(folder)
    assert (folder / "chunk-00000001.npz").exists()
    assert not list(folder.glob(".part-*"))


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write")
def test_a_folder_that_cannot_be_written(folder, whole):
    folder.chmod(0o500)
    assert_same(sweep(folder), whole[1])  # nothing has to be written
    with pytest.raises(ns.OptionError, match="checkpoint"):
        sweep(folder / "below")


@pytest.mark.parametrize("name", ["file/below", "nul\0", "x" * 300])
def test_a_path_that_can_be_no_folder(name, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ns.OptionError, match="checkpoint"):
        sweep(tmp_path / name)


@pytest.mark.parametrize("path", [3, 2.5, b"bytes", "", ["a"]])
def test_a_path_that_is_none(path):
    with pytest.raises(ns.OptionError, match="checkpoint"):
        ns.Work(checkpoint=path)
