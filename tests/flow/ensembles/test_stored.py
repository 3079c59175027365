"""Results in a folder are those in memory, to the bit, also after an interruption, a loss or damage."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.ensembles import work as work_module
from nonsmooth.flow.ensembles.work import size_of_chunk

x, v, mu = (ca.SX.sym(s) for s in ("x", "v", "mu"))
BLOCK = ns.FilippovSystem(
    [x, v], surface=v, above=[v, -x - mu], below=[v, -x + mu], parameters={mu: 1.0}
)
STARTS = ns.RandomStarts(200, low=[-6.0, -6.0], high=[6.0, 6.0], seed=5)
OPTIONS = dict(t_end=9.0, at_event=("entry", 1), t_eval=[1.0, 5.0])


def sweep(store=None, chunk=30, starts=STARTS, **kwargs):
    work = ns.Work(store=store, chunk=chunk, threads=1, progress=False, **kwargs)
    return ns.ensemble(BLOCK, starts, work=work, **OPTIONS)


@pytest.fixture(scope="module")
def whole():
    return sweep()


def assert_same(a, b):
    for name in (
        "x",
        "t",
        "status",
        "itinerary_code",
        "event_x",
        "event_t",
        "sample_x",
        "sample_t",
    ):
        one, two = getattr(a, name), getattr(b, name)
        assert one.dtype == two.dtype and one.tobytes() == two.tobytes(), name
    assert a.itineraries == b.itineraries
    assert all(np.array_equal(a.events[kind], b.events[kind]) for kind in a.events)


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


@pytest.fixture()
def counted(monkeypatch):
    """The sizes of the chunks that are computed."""
    sizes, run = [], work_module.run_chunk
    monkeypatch.setattr(
        work_module, "run_chunk", lambda job, x, *a: sizes.append(len(x)) or run(job, x, *a)
    )
    return sizes


def test_what_is_there_is_not_computed_again(whole, tmp_path, counted):
    sweep(tmp_path / "sweep")
    counted.clear()
    assert_same(sweep(tmp_path / "sweep", chunk=7), whole)
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


@pytest.mark.parametrize("name", ["x", "t", "status", "itinerary", "kinds", "at_x", "sample_x"])
def test_rows_that_were_changed_are_computed_again(name, whole, tmp_path, counted):
    sweep(tmp_path / "sweep")
    array = np.load(tmp_path / "sweep" / f"{name}.npy", mmap_mode="r+")
    array[77] += 1
    array.flush()
    counted.clear()
    assert_same(sweep(tmp_path / "sweep"), whole)
    assert counted == [30]


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b'{"words": ["+"], "totals": [0], "seal": "00"}']
)
def test_a_damaged_note_of_a_chunk_is_made_again(content, whole, tmp_path, counted):
    sweep(tmp_path / "sweep")
    (tmp_path / "sweep" / "chunk-00000002.json").write_bytes(content)
    counted.clear()
    assert_same(sweep(tmp_path / "sweep"), whole)
    assert counted == [30]


def test_a_lost_array_is_computed_again(whole, tmp_path):
    sweep(tmp_path / "sweep")
    (tmp_path / "sweep" / "x.npy").unlink()
    assert_same(sweep(tmp_path / "sweep"), whole)


@pytest.mark.parametrize(
    "wrong", ["shape", "type", "text", "link", "pickle", "folder", "empty", "archive", "header"]
)
def test_a_file_that_is_no_such_array_is_refused(wrong, tmp_path):
    sweep(tmp_path / "sweep")
    path = tmp_path / "sweep" / "t.npy"
    path.unlink()
    if wrong == "shape":
        np.save(path, np.zeros(199))
    elif wrong == "type":
        np.save(path, np.zeros(200, np.float32))
    elif wrong == "text":
        path.write_text("no array")
    elif wrong == "empty":
        path.write_bytes(b"")
    elif wrong == "archive":
        np.savez(tmp_path / "other.npz", t=np.zeros(200))
        path.write_bytes((tmp_path / "other.npz").read_bytes())
    elif wrong == "header":
        np.save(path, np.zeros(200))
        path.write_bytes(path.read_bytes().replace(b"'shape': (200,)", b"'shape': ((200,"))
    elif wrong == "link":
        np.save(tmp_path / "elsewhere.npy", np.zeros(200))
        path.symlink_to(tmp_path / "elsewhere.npy")
    elif wrong == "pickle":
        np.save(path, np.array([{}] * 200, object), allow_pickle=True)
    else:
        path.mkdir()
    with pytest.raises(ns.OptionError, match="store"):
        sweep(tmp_path / "sweep")
    if wrong == "link":
        assert not np.load(tmp_path / "elsewhere.npy").any()


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
    facts = [path.stat() for path in (tmp_path / "sweep").glob("*.npy")]
    assert len(facts) == 10 and sum(f.st_size for f in facts) > 10**7
    assert all(512 * f.st_blocks >= f.st_size for f in facts)


@needs_reserving
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT])
def test_a_disk_without_room_is_told_at_once(code, whole, tmp_path, monkeypatch, counted):
    def full(*args):
        raise OSError(code, os.strerror(code))

    with monkeypatch.context() as patched:
        patched.setattr(os, "posix_fallocate", full)
        with pytest.raises(ns.OptionError, match=f"store.*{os.strerror(code)}"):
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
        with pytest.raises(ns.OptionError, match="another run") as caught:
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
        with pytest.raises(ns.OptionError, match="another run"):
            sweep(tmp_path / "sweep")
        other.kill()
    assert_same(sweep(tmp_path / "sweep"), whole)


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="links are followed on this system")
def test_a_link_in_the_place_of_the_lock_is_not_followed(tmp_path):
    sweep(tmp_path / "sweep")
    (tmp_path / "sweep" / ".lock").unlink()
    (tmp_path / "elsewhere").write_text("kept")
    (tmp_path / "sweep" / ".lock").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ns.OptionError, match="checkpoint"):
        sweep(tmp_path / "sweep")
    assert (tmp_path / "elsewhere").read_text() == "kept"


def test_a_run_that_was_refused_or_interrupted_holds_nothing(whole, tmp_path, monkeypatch):
    def interrupted(*args):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(work_module, "run_chunk", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sweep(tmp_path / "sweep")
    assert_same(sweep(tmp_path / "sweep"), whole)


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
    assert os.strerror(errno.ENOSPC) in found.stdout and "Make room" in found.stdout


def test_another_problem_and_a_checkpoint_are_refused(tmp_path):
    sweep(tmp_path / "sweep")
    with pytest.raises(ns.OptionError, match="another system"):
        sweep(tmp_path / "sweep", starts=ns.RandomStarts(200, [0, 0], [1, 1]))
    with pytest.raises(ns.OptionError, match="another system"):
        ns.ensemble(BLOCK, STARTS, work=ns.Work(checkpoint=tmp_path / "sweep"), **OPTIONS)
    with pytest.raises(ns.OptionError, match=r"checkpoint.*store"):
        ns.Work(store="a", checkpoint="b")


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

    class Many:
        rows = staticmethod(lambda index: (index, None))

    Many.count = count
    assert least <= size_of_chunk(None, Many, workers) <= most


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

        executor = Killing(client)
        work = ns.Work(store=tmp_path / "sweep", chunk=10, executor=executor, progress=False)
        found = ns.ensemble(BLOCK, STARTS, work=work, **OPTIONS)
        assert killed and killed[0] not in client.run(os.getpid).values()
    assert_same(found, whole)


def test_time_of_other_processes_is_not_counted(monkeypatch):
    """A processor that others have for most of the time does not make small chunks."""
    monkeypatch.setattr(work_module, "run_chunk", lambda job, x, p: time.sleep(0.05))

    class Many:
        count = 200_000
        rows = staticmethod(lambda index: (index, None))

    assert size_of_chunk(None, Many, 1) >= 50_000


@pytest.mark.parametrize("once", [0.01, 0.05])
def test_what_is_done_once_does_not_make_small_chunks(once, monkeypatch):
    """The first trajectory prepares what all use; each takes 1e-6 s."""
    clock, calls = [0.0], []

    def run(job, x, p):
        calls.append(len(x))
        clock[0] += 1e-6 * len(x) + (once if len(calls) == 1 else 0.0)

    monkeypatch.setattr(work_module, "run_chunk", run)
    monkeypatch.setattr(work_module, "_clock", lambda: clock[0])

    class Many:
        count = 200_000
        rows = staticmethod(lambda index: (index, None))

    assert size_of_chunk(None, Many, 1) == 50_000
    assert sum(calls) < 0.01 * Many.count
