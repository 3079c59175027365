"""Results in a store are those in memory, to the bit, also after an interruption, a loss or damage."""

import errno
import json
import multiprocessing
import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.ensembles import store as store_module
from nonsmooth.flow.ensembles import work as work_module
from nonsmooth.flow.ensembles.work import size_of_chunk

x, v, mu = (ca.SX.sym(s) for s in ("x", "v", "mu"))
BLOCK = ns.FilippovSystem(
    [x, v], surface=v, above=[v, -x - mu], below=[v, -x + mu], parameters={mu: 1.0}
)
STARTS = ns.RandomStarts(200, low=[-6.0, -6.0], high=[6.0, 6.0], seed=5)
OPTIONS = dict(t_end=9.0, at_event=("entry", 1), t_eval=[1.0, 5.0])


def sweep(store=None, chunk=30, starts=STARTS, system=BLOCK, executor=None, **options):
    work = ns.Work(store=store, chunk=chunk, threads=1, executor=executor, progress=False)
    return ns.ensemble(system, starts, work=work, **{**OPTIONS, **options})


@pytest.fixture(scope="module")
def whole():
    return sweep()


def assert_same(a, b):
    for name in "x t status itinerary_code event_x event_t sample_x sample_t".split():
        one, two = getattr(a, name), getattr(b, name)
        assert one.dtype == two.dtype and one.tobytes() == two.tobytes(), name
    assert a.itineraries == b.itineraries
    assert all(np.array_equal(a.events[kind], b.events[kind]) for kind in a.events)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept") / "sweep"
    sweep(folder)
    return folder


@pytest.fixture
def folder(kept, tmp_path):
    """A store of all results."""
    return shutil.copytree(kept, tmp_path / "sweep")


def test_a_store_has_the_results(whole, tmp_path):
    found = sweep(tmp_path / "sweep")
    assert_same(found, whole)
    np.testing.assert_array_equal(np.load(tmp_path / "sweep" / "x.npy"), whole.x)
    np.testing.assert_array_equal(
        np.load(tmp_path / "sweep" / "itinerary_code.npy"), whole.itinerary_code
    )


def test_its_arrays_are_mapped_not_held(tmp_path):
    found = sweep(tmp_path / "sweep")
    for array in (found.x, found.t, found.itinerary_code, found.sample_x):
        while array.base is not None and not isinstance(array, np.memmap):
            array = array.base
        assert isinstance(array, np.memmap)
    assert_same(pickle.loads(pickle.dumps(found)), found)


@pytest.fixture()
def counted(monkeypatch):
    """The sizes of the chunks that are computed."""
    sizes, run = [], work_module.run_chunk
    monkeypatch.setattr(
        work_module, "run_chunk", lambda job, x, *a: sizes.append(len(x)) or run(job, x, *a)
    )
    return sizes


def test_what_is_there_is_not_computed_again(whole, folder, counted):
    assert_same(sweep(folder, chunk=7), whole)  # the folder has its own size of a chunk
    assert_same(sweep(folder, system=pickle.loads(pickle.dumps(BLOCK))), whole)
    assert counted == []


def test_an_interruption_costs_what_was_under_way(whole, tmp_path, counted, monkeypatch):
    run = work_module.run_chunk

    def interrupted(*args):
        if len(counted) == 3:
            raise KeyboardInterrupt
        return run(*args)

    with monkeypatch.context() as patched:
        patched.setattr(work_module, "run_chunk", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sweep(tmp_path / "sweep")
    counted.clear()
    assert_same(sweep(tmp_path / "sweep"), whole)
    assert counted == [30, 30, 30, 20]


class Interrupted(Executor):
    """Ctrl-C after three chunks."""

    left = 3

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        self.left -= 1
        if self.left < 0:
            future.set_exception(KeyboardInterrupt())
        else:
            future.set_result(fn(*args, **kwargs))
        return future


def die(*_):
    os.kill(os.getpid(), signal.SIGKILL)


class Murdered(ProcessPoolExecutor):
    """A pool whose worker the system kills after three chunks, as when memory runs out."""

    left = 3

    def __init__(self):
        super().__init__(1, mp_context=multiprocessing.get_context("spawn"))

    def submit(self, fn, /, *args, **kwargs):
        self.left -= 1
        return super().submit(fn if self.left >= 0 else die, *args, **kwargs)


@pytest.mark.parametrize(
    ("pool", "error"), [(Interrupted, KeyboardInterrupt), (Murdered, BrokenExecutor)]
)
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_so_does_one_of_an_executor(pool, error, whole, tmp_path, counted):
    with pool() as executor, pytest.raises(error):
        sweep(tmp_path / "sweep", executor=executor)
    assert_same(sweep(tmp_path / "sweep"), whole)
    assert counted == [30, 30, 30, 20]


@pytest.mark.parametrize("name", ["x", "t", "status", "itinerary", "kinds", "at_x", "sample_x"])
def test_rows_that_were_changed_are_computed_again(name, whole, folder, counted):
    array = np.load(folder / f"{name}.npy", mmap_mode="r+")
    array[77] += 1
    array.flush()
    assert_same(sweep(folder), whole)
    assert counted == [30]


# the note of a chunk


NOTE = "chunk-00000002.json"


def edited(**changes):
    def damage(path):
        path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))

    return damage


def written(content):
    return lambda path: path.write_bytes(content)


def cut(part):
    return lambda path: path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])


def flipped(place):
    def damage(path):
        data = bytearray(path.read_bytes())
        data[int(place * len(data))] ^= 1
        path.write_bytes(bytes(data))

    return damage


def a_pipe(path):
    path.unlink()
    os.mkfifo(path)


def a_link_to_itself(path):
    path.unlink()
    path.symlink_to(path)


DAMAGE = {
    "empty": written(b""),
    "brace": written(b"{"),
    "list": written(b"[]"),
    "deep": written(b"[" * 100_000),
    "no text": written(b"\xff\xfe\x00"),
    **{f"cut at {p}": cut(p) for p in (0.1, 0.5, 0.9, 0.999)},
    **{f"bit at {p}": flipped(p) for p in np.linspace(0, 0.9999, 25).round(4)},
    "other words": edited(words=["+"]),
    "words of no text": edited(words=[1, 2]),
    "no words": edited(words=None),
    "other totals": edited(totals=[0, 0, 0, 0]),
    "no totals": edited(totals={}),
    "no seal": edited(seal=None),
    "another seal": edited(seal="00"),
    "another place": lambda path: shutil.copy(path.with_name("chunk-00000000.json"), path),
    "gone": lambda path: path.unlink(),
    "pipe": a_pipe,
    "link to itself": a_link_to_itself,
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_chunk_with_a_damaged_note_is_computed_again(kind, folder, whole, counted):
    DAMAGE[kind](folder / NOTE)
    assert_same(sweep(folder), whole)
    assert counted == [30]
    assert_same(sweep(folder), whole)
    assert counted == [30]


def test_a_chunk_of_another_problem_is_computed_again(folder, whole, counted, tmp_path):
    other = ns.RandomStarts(200, low=[-6.0, -6.0], high=[6.0, 6.0], seed=6)
    sweep(tmp_path / "other", starts=other)
    for name in (NOTE, "x.npy", "t.npy", "status.npy", "itinerary.npy", "kinds.npy"):
        shutil.copy(tmp_path / "other" / name, folder / name)
    counted.clear()
    assert_same(sweep(folder), whole)
    assert counted == [30] * 6 + [20]


def test_a_link_in_the_place_of_a_note_is_replaced_not_followed(folder, whole, tmp_path):
    (tmp_path / "elsewhere").write_text("kept")
    (folder / NOTE).unlink()
    (folder / NOTE).symlink_to(tmp_path / "elsewhere")
    assert_same(sweep(folder), whole)
    assert (tmp_path / "elsewhere").read_text() == "kept" and not (folder / NOTE).is_symlink()


def test_where_a_note_cannot_be_written_the_others_are_kept(folder):
    (folder / NOTE).unlink()
    (folder / NOTE).mkdir()
    (folder / NOTE / "in the way").write_text("")
    with pytest.raises(ns.OptionError, match="store"):
        sweep(folder)
    assert (folder / "chunk-00000001.json").exists() and not list(folder.glob(".part-*"))


# the arrays


@pytest.mark.parametrize("damage", [lambda path: path.unlink(), cut(0.6)])
def test_a_lost_or_cut_array_is_computed_again(damage, whole, folder):
    damage(folder / "x.npy")
    assert_same(sweep(folder), whole)
    size = (folder / "x.npy").stat()
    assert 512 * size.st_blocks >= size.st_size or not hasattr(os, "posix_fallocate")


def linked(path):
    path.rename(path.parent.parent / "elsewhere.npy")
    path.symlink_to(path.parent.parent / "elsewhere.npy")


def a_folder(path):
    path.unlink()
    path.mkdir()


def an_archive(path):
    with path.open("wb") as file:
        np.savez(file, t=np.zeros(200))


def a_header_that_does_not_close(path):
    np.save(path, np.zeros(200))
    path.write_bytes(path.read_bytes().replace(b"'shape': (200,)", b"'shape': ((200,"))


ARRAYS = {
    "shape": lambda path: np.save(path, np.zeros(199)),
    "type": lambda path: np.save(path, np.zeros(200, np.float32)),
    "bytes in another order": lambda path: np.save(path, np.zeros(200, ">f8")),
    "text": written(b"no array"),
    "empty": written(b""),
    "archive": an_archive,
    "header": a_header_that_does_not_close,
    "pickle": lambda path: np.save(path, np.array([{}] * 200, object), allow_pickle=True),
    "link": linked,
    "folder": a_folder,
    "pipe": a_pipe,
}


@pytest.mark.parametrize("wrong", ARRAYS)
def test_a_file_that_is_no_such_array_is_refused(wrong, folder):
    ARRAYS[wrong](folder / "t.npy")
    with pytest.raises(ns.OptionError, match=r"store.*t\.npy"):
        sweep(folder)


@pytest.mark.parametrize("place", range(0, 128, 3))
def test_no_bit_of_the_head_of_an_array_changes_results(place, folder, whole):
    with (folder / "t.npy").open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ 1]))
    try:
        found = sweep(folder)
    except ns.OptionError as error:
        assert "t.npy" in str(error)
    else:
        assert_same(found, whole)


def test_two_kinds_of_damage_of_one_array_are_found(folder, whole, counted):
    """Numbers beside the true ones by rounding, and a status that is none."""
    for name, change in (("x", lambda a: a * (1 + 4e-16)), ("status", lambda a: 77)):
        array = np.load(folder / f"{name}.npy", mmap_mode="r+")
        array[90:120] = change(array[90:120])
        array.flush()
    assert_same(sweep(folder), whole)
    assert counted == [30]


# room and other runs


needs_reserving = pytest.mark.skipif(
    not hasattr(os, "posix_fallocate"), reason="no room can be reserved on this system"
)


@needs_reserving
def test_the_room_of_all_rows_is_taken_before_the_first_is_computed(tmp_path, monkeypatch):
    """Where a disk fills up under a mapped array, the system ends the process without a word."""

    def interrupted(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(work_module, "run_chunk", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sweep(tmp_path / "sweep", starts=ns.RandomStarts(10**5, low=[0, 0], high=[1, 1]))
    files = [path.stat() for path in (tmp_path / "sweep").glob("*.npy")]
    assert len(files) == 10 and sum(f.st_size for f in files) > 10**7
    assert all(512 * f.st_blocks >= f.st_size for f in files)


@needs_reserving
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT])
def test_a_disk_without_room_is_reported_at_once(code, whole, tmp_path, monkeypatch, counted):
    def full(*args):
        raise OSError(code, os.strerror(code))

    with monkeypatch.context() as patched:
        patched.setattr(os, "posix_fallocate", full)
        with pytest.raises(ns.OptionError, match=rf"store.*{os.strerror(code)}"):
            sweep(tmp_path / "sweep")
    left = {f.name for f in (tmp_path / "sweep").iterdir()}
    assert counted == [] and left <= {"problem.json", ".lock"}
    assert_same(sweep(tmp_path / "sweep"), whole)


@needs_reserving
def test_a_folder_where_none_can_be_reserved_is_used_all_the_same(whole, tmp_path, monkeypatch):
    def refused(*args):
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))

    monkeypatch.setattr(os, "posix_fallocate", refused)
    assert_same(sweep(tmp_path / "sweep"), whole)


def test_a_folder_that_another_run_writes_to_is_refused(whole, tmp_path, monkeypatch):
    """Both would write to the same rows, and one read what the other has not finished."""
    run, said = work_module.run_chunk, []

    def within(*args):
        monkeypatch.setattr(work_module, "run_chunk", run)
        with pytest.raises(ns.OptionError, match=r"store.* another run") as caught:
            sweep(tmp_path / "sweep")
        said.append(str(caught.value))
        return run(*args)

    monkeypatch.setattr(work_module, "run_chunk", within)
    assert_same(sweep(tmp_path / "sweep"), whole)
    assert len(said) == 1 and str(tmp_path / "sweep") in said[0]
    assert_same(sweep(tmp_path / "sweep"), whole)


def test_so_is_one_of_another_process_until_that_ends(whole, tmp_path):
    pytest.importorskip("fcntl")
    sweep(tmp_path / "sweep")
    program = (
        "import fcntl, sys\n"
        "file = open(sys.argv[1], 'w')\n"
        "fcntl.lockf(file, fcntl.LOCK_EX)\n"
        "print('held', flush=True)\n"
        "sys.stdin.read()\n"
    )
    run = [sys.executable, "-c", program, tmp_path / "sweep" / ".lock"]
    with subprocess.Popen(run, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(ns.OptionError, match=r"store.* another run"):
            sweep(tmp_path / "sweep")
        other.kill()
    assert_same(sweep(tmp_path / "sweep"), whole)


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="links are followed on this system")
def test_a_link_in_the_place_of_the_lock_is_not_followed(tmp_path):
    sweep(tmp_path / "sweep")
    (tmp_path / "sweep" / ".lock").unlink()
    (tmp_path / "elsewhere").write_text("kept")
    (tmp_path / "sweep" / ".lock").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ns.OptionError, match="store"):
        sweep(tmp_path / "sweep")
    assert (tmp_path / "elsewhere").read_text() == "kept"


@pytest.mark.slow
@needs_reserving
def test_a_disk_that_is_too_small_ends_no_process(tmp_path):
    """On a real one of two megabytes, which a user may mount in a name space of his own."""
    mounts = ["unshare", "-rm", "sh", "-c", 'mount -t tmpfs -o size=2m tmpfs "$0" && exec "$@"']
    if not shutil.which("unshare") or subprocess.run([*mounts, tmp_path, "true"]).returncode:
        pytest.skip("no file system can be mounted here")
    program = (
        "import sys, casadi as ca, nonsmooth as ns\n"
        "x = ca.SX.sym('x')\n"
        "system = ns.FilippovSystem([x], surface=x, above=[-1], below=[1])\n"
        "starts = ns.RandomStarts(10**6, low=[-1], high=[1])\n"
        "try:\n"
        "    ns.ensemble(system, starts, 2.0, work=ns.Work(store=sys.argv[1], progress=False))\n"
        "except ns.OptionError as error:\n"
        "    print(error)\n"
    )
    run = [*mounts, tmp_path, sys.executable, "-c", program, tmp_path / "sweep"]
    found = subprocess.run(run, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found
    assert os.strerror(errno.ENOSPC) in found.stdout


# the problem and the folder


@pytest.mark.parametrize(
    "other",
    [
        {"starts": ns.RandomStarts(200, [0, 0], [1, 1])},
        {"starts": ns.RandomStarts(199, low=[-6.0, -6.0], high=[6.0, 6.0], seed=5)},
        {"starts": ns.RandomStarts(200, low=[-6.0, -6.0], high=[6.0, 6.0], seed=6)},
        {"t_end": 9.5},
        {"tol": 1e-9},
        {"t_eval": [1.0, 5.5]},
        {"parameters": {"mu": 0.2}},
        {"parameters": {"mu": np.ones(200)}},
    ],
)
def test_another_problem_is_refused(other, folder):
    with pytest.raises(ns.OptionError, match=r"store.* another system"):
        sweep(folder, **other)


def test_other_numbers_are_another_problem(tmp_path):
    starts = np.linspace(-1, 1, 20).reshape(10, 2)
    sweep(tmp_path / "sweep", starts=starts)
    starts[7, 1] = np.nextafter(starts[7, 1], 1)
    with pytest.raises(ns.OptionError, match=r"store.* another system"):
        sweep(tmp_path / "sweep", starts=starts)


def sealed_anew(chunk):
    def damage(path):
        own = {k: v for k, v in json.loads(path.read_text()).items() if k != "seal"}
        path.write_text(json.dumps(store_module._sealed(own | {"chunk": chunk})))

    return damage


HEADS = {
    "chunk beyond every index": sealed_anew(10**40),
    "chunk of no rows": sealed_anew(0),
    **{
        f"chunk {c!r}"[:20]: edited(chunk=c)
        for c in (0, -5, 3, 49, 10**9, 10**400, True, 4.0, "4", None, [4])
    },
    "empty": written(b""),
    "number": written(b"3"),
    "list": written(b"[]"),
    "deep": written(b"[" * 4000),
    "long": written(b"[" * 100_000),
    "no text": written(b"\xff\xfe\x00"),
    "cut": cut(0.5),
    "pipe": a_pipe,
    "link to itself": a_link_to_itself,
    "seal": edited(seal="0" * 64),
}


@pytest.mark.parametrize("kind", HEADS)
def test_a_damaged_problem_is_refused(kind, folder):
    HEADS[kind](folder / "problem.json")
    with pytest.raises(ns.OptionError, match=r"store.* damaged problem"):
        sweep(folder)


@pytest.mark.parametrize("version", [1, 2, 4, 99])
def test_another_version_is_refused(version, folder):
    edited(format=version)(folder / "problem.json")
    with pytest.raises(ns.OptionError, match=r"store.* another version"):
        sweep(folder)


def test_a_folder_with_nothing_but_files_under_way_is_used(tmp_path, whole):
    """A process that is killed while it writes the first file leaves only that and its lock."""
    (tmp_path / ".part-abc").write_bytes(b"half")
    (tmp_path / ".lock").write_bytes(b"")
    assert_same(sweep(tmp_path), whole)


def test_a_folder_with_other_files_is_refused_and_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(ns.OptionError, match=r"store.* other files"):
        sweep(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_whole_store_is_read_where_nothing_can_be_written(folder, whole, counted, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    found = sweep(folder)
    assert_same(found, whole)
    found.x[:] = 0.0  # in memory only
    assert counted == [] and before == {p.name: p.read_bytes() for p in folder.iterdir()}


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write")
def test_a_folder_that_cannot_be_written(folder, whole):
    folder.chmod(0o500)
    assert_same(sweep(folder), whole)
    (folder / NOTE).write_text("")
    with pytest.raises(ns.OptionError, match="store"):
        sweep(folder)
    with pytest.raises(ns.OptionError, match="store"):
        sweep(folder / "below")


@pytest.mark.parametrize("name", ["file", "file/below", "nul\0", "x" * 300])
def test_a_path_that_can_be_no_folder(name, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ns.OptionError, match="store"):
        sweep(tmp_path / name)


@pytest.mark.parametrize("path", [3, 2.5, b"bytes", "", ["a"]])
def test_a_path_that_is_none(path):
    with pytest.raises(ns.OptionError, match="store"):
        ns.Work(store=path)


def test_nothing_is_stored_for_no_starts(tmp_path):
    found = sweep(tmp_path / "sweep", starts=np.zeros((0, 2)))
    assert found.t.shape == (0,) and found.itineraries == ()


def test_without_a_size_chunks_are_sized_by_time(whole, tmp_path, counted):
    """However long they are, every start is run once more than the few that were timed."""
    assert_same(sweep(tmp_path / "sweep", chunk=None), whole)
    size = json.loads((tmp_path / "sweep" / "problem.json").read_text())["chunk"]
    assert 1 <= size <= 200
    counted.clear()
    assert_same(sweep(tmp_path / "sweep", chunk=None), whole)
    assert counted == []


def numbered(count):
    """So many starts, which are their numbers."""
    return SimpleNamespace(count=count, rows=lambda index: (index, None))


@pytest.mark.parametrize(
    ("each", "count", "workers", "least", "most"),
    [
        (1e-6, 10**9, 2, 2**18, 2**18),
        (1e-3, 10**6, 2, 900, 1000),
        (10.0, 1000, 4, 1, 1),
        (1e-7, 1000, 2, 1000, 1000),
    ],
)
def test_the_size_follows_the_time_of_a_trajectory(each, count, workers, least, most, monkeypatch):
    clock = [0.0]

    def run(job, x, p):
        clock[0] += each * len(x)

    monkeypatch.setattr(work_module, "run_chunk", run)
    monkeypatch.setattr(work_module, "_clock", lambda: clock[0])

    assert least <= size_of_chunk(None, numbered(count), workers) <= most


@pytest.mark.slow
def test_a_worker_that_is_lost_costs_its_chunk(whole, tmp_path):
    """One of the processes of a cluster is killed in the middle; the scheduler gives its chunk to another."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = client.run(os.getpid)
        killed = []

        class Killing(type(client.get_executor())):
            def submit(self, *args, **kwargs):
                future = super().submit(*args, **kwargs)
                if not killed:
                    killed.append(next(iter(pids.values())))
                    os.kill(killed[0], signal.SIGKILL)
                return future

        found = sweep(tmp_path / "sweep", chunk=10, executor=Killing(client))
        assert killed and killed[0] not in client.run(os.getpid).values()
    assert_same(found, whole)


def test_time_of_other_processes_is_not_counted(monkeypatch):
    """A processor that others have for most of the time does not make small chunks."""
    monkeypatch.setattr(work_module, "run_chunk", lambda job, x, p: time.sleep(0.05))
    assert size_of_chunk(None, numbered(200_000), 1) >= 50_000


@pytest.mark.parametrize("once", [0.01, 0.05])
def test_what_is_done_once_does_not_make_small_chunks(once, monkeypatch):
    """The first trajectory prepares what all use; each takes 1e-6 s."""
    clock, calls = [0.0], []

    def run(job, x, p):
        calls.append(len(x))
        clock[0] += 1e-6 * len(x) + (once if len(calls) == 1 else 0.0)

    monkeypatch.setattr(work_module, "run_chunk", run)
    monkeypatch.setattr(work_module, "_clock", lambda: clock[0])

    assert size_of_chunk(None, numbered(200_000), 1) == 50_000
    assert sum(calls) < 2000
