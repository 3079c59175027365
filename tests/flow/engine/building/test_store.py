"""No library is loaded that this user did not build: folder, entries and links are not believed."""

import ctypes
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from nonsmooth.flow.engine.building import store
from nonsmooth.flow.engine.building.build import build, compile_library, find_compiler, library_key
from nonsmooth.flow.saving import files
from nonsmooth.flow.warn import CompilerWarning, warn_once

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
    pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners and modes of another kind"),
]

SOURCE = "int answer(void) { return 42; }\n"


@pytest.fixture(autouse=True)
def once_again():
    warn_once.cache_clear()


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NONSMOOTH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def mode(path):
    return stat.S_IMODE(os.stat(path).st_mode)


def entry(cache, source=SOURCE):
    return cache / f"{library_key(source, find_compiler())}.so"


def plant(cache, tmp_path, name=None):
    """A library that says where it was loaded, sealed as ours is, under the name of ours."""
    reported = tmp_path / "told"
    text = (
        "#include <stdio.h>\n__attribute__((constructor)) static void told(void)"
        f'{{ FILE *f = fopen("{reported}", "w"); if (f) fclose(f); }}\n{SOURCE}'
    )
    work = tmp_path / "attacker"
    work.mkdir(mode=0o700)
    made = work / entry(cache).name
    compile_library(text, find_compiler(), made)
    target = name or entry(cache)
    os.replace(made, target)
    return target, reported


def test_the_folder_and_its_entries_are_for_the_owner_whatever_the_umask(tmp_path, monkeypatch):
    folder = tmp_path / "a" / "b" / "cache"
    monkeypatch.setenv("NONSMOOTH_CACHE", str(folder))
    before = os.umask(0)
    try:
        assert build(SOURCE).answer() == 42
    finally:
        os.umask(before)
    assert [mode(p) for p in (folder, folder.parent, folder.parent.parent)] == [0o700] * 3
    assert mode(entry(folder)) == 0o600


@pytest.mark.parametrize("open_to", [0o777, 0o770, 0o775, 0o722, 0o1777])
def test_nothing_is_loaded_from_a_folder_that_others_can_write(open_to, cache, tmp_path):
    cache.mkdir()
    _, reported = plant(cache, tmp_path)
    cache.chmod(open_to)
    with pytest.warns(CompilerWarning, match=f"mode {open_to:04o}"):
        assert build(SOURCE).answer() == 42
    assert not reported.exists() and mode(cache) == open_to


def give_away(folder, monkeypatch, place=4, number=12345):
    """Let a folder belong to another user, or to a group by its place in what is known of a file."""
    real, foreign = os.lstat, os.lstat(folder).st_ino

    def lstat(path, **options):
        facts = real(path, **options)
        if facts.st_ino != foreign:
            return facts
        return os.stat_result([*facts[:place], number, *facts[place + 1 :]])

    monkeypatch.setattr(os, "lstat", lstat)


def test_nothing_is_loaded_from_a_folder_of_another_user(cache, tmp_path, monkeypatch):
    cache.mkdir(mode=0o700)
    _, reported = plant(cache, tmp_path)
    give_away(cache, monkeypatch)
    with pytest.warns(CompilerWarning, match="user 12345"):
        assert build(SOURCE).answer() == 42
    assert not reported.exists()


@pytest.mark.parametrize("open_to", [0o777, 0o772])
def test_nor_from_one_that_lies_where_others_could_exchange_it(open_to, tmp_path, monkeypatch):
    above = tmp_path / "above"
    monkeypatch.setenv("NONSMOOTH_CACHE", str(above / "cache"))
    above.mkdir()
    above.chmod(open_to)
    with pytest.warns(CompilerWarning, match="above"):
        assert build(SOURCE).answer() == 42
    above.chmod(0o1777)  # there nobody can rename what is another's
    warn_once.cache_clear()
    assert build(SOURCE).answer() == 42 and entry(above / "cache").exists()


def test_a_group_of_nobody_else_may_write_the_folders_above(tmp_path, monkeypatch):
    above = tmp_path / "above"
    monkeypatch.setenv("NONSMOOTH_CACHE", str(above / "cache"))
    above.mkdir()
    above.chmod(0o775)
    monkeypatch.setattr(store, "_is_private", lambda group: False)
    with pytest.warns(CompilerWarning, match="above"):
        assert build(SOURCE).answer() == 42
    monkeypatch.setattr(store, "_is_private", lambda group: group == above.stat().st_gid)
    assert build(SOURCE).answer() == 42 and entry(above / "cache").exists()


@pytest.mark.parametrize("open_to", [0o660, 0o606, 0o666, 0o620])
def test_an_entry_that_others_can_write_is_built_again(open_to, cache, tmp_path):
    cache.mkdir(mode=0o700)
    planted, reported = plant(cache, tmp_path)
    planted.chmod(open_to)
    assert build(SOURCE).answer() == 42
    assert not reported.exists() and mode(planted) == 0o600


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives away")
def test_an_entry_of_another_user_is_built_again(cache, tmp_path):
    cache.mkdir(mode=0o700)
    planted, reported = plant(cache, tmp_path)
    os.chown(planted, 12345, 12345)
    assert build(SOURCE).answer() == 42
    assert not reported.exists() and planted.stat().st_uid == 0


def test_a_link_in_the_place_of_an_entry_is_not_followed(cache, tmp_path):
    cache.mkdir(mode=0o700)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    planted, reported = plant(cache, tmp_path, elsewhere / entry(cache).name)
    content = planted.read_bytes()
    entry(cache).symlink_to(planted)
    assert build(SOURCE).answer() == 42
    assert (
        not reported.exists() and planted.read_bytes() == content and not entry(cache).is_symlink()
    )


def test_an_entry_under_the_name_of_another_is_built_again(cache):
    other = "int answer(void) { return 0; }\n"
    assert build(other).answer() == 0
    os.replace(entry(cache, other), entry(cache))
    assert build(SOURCE).answer() == 42


def test_a_library_of_another_source_that_is_sealed_is_built_again(cache, tmp_path):
    assert build(SOURCE).answer() == 42
    subprocess.run(
        [*find_compiler(), "-shared", "-fPIC", "-x", "c", "-", "-o", tmp_path / "other.so"],
        input="int other(void) { return 1; }\n",
        text=True,
        check=True,
    )
    forged = store.sealed(entry(cache).name, (tmp_path / "other.so").read_bytes())
    files.replace(entry(cache), forged)
    assert build(SOURCE).answer() == 42


@pytest.mark.parametrize("kind", ["pipe", "device", "empty", "tail only"])
def test_what_is_no_library_is_replaced(kind, cache):
    cache.mkdir(mode=0o700)
    place = entry(cache)
    if kind == "pipe":
        os.mkfifo(place)
    elif kind == "device":
        place.symlink_to("/dev/zero")
    else:
        place.write_bytes(b"" if kind == "empty" else store.sealed(place.name, b""))
    assert build(SOURCE).answer() == 42
    assert place.is_file()


def test_a_folder_in_the_place_of_an_entry_is_reported(cache):
    cache.mkdir(mode=0o700)
    entry(cache).mkdir()
    with pytest.raises(store.CompilerError, match="cache"):
        build(SOURCE)


def test_the_source_of_a_failure_is_not_written_through_a_link(cache, tmp_path):
    cache.mkdir(mode=0o700)
    victim, source = tmp_path / "victim", "int broken( { }\n"
    victim.write_text("precious")
    entry(cache, source).with_suffix(".c").symlink_to(victim)
    with pytest.raises(store.CompilerError, match=r"compiler[\s\S]*source"):
        build(source)
    assert victim.read_text() == "precious"


@pytest.mark.parametrize("name", [".", "cache", "a/../cache", "./a/b"])
def test_a_relative_folder(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").mkdir()
    monkeypatch.setenv("NONSMOOTH_CACHE", name)
    assert build(SOURCE).answer() == 42
    assert entry(Path(name)).exists()


def test_a_relative_xdg_folder_is_ignored_as_its_rules_say(monkeypatch, tmp_path):
    monkeypatch.delenv("NONSMOOTH_CACHE", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    assert store.cache_directory() == tmp_path / ".cache" / "nonsmooth"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert store.cache_directory() == tmp_path / "xdg" / "nonsmooth"


def test_our_own_folder_in_the_home_is_closed_again(monkeypatch, tmp_path):
    """Earlier versions left it to the umask."""
    monkeypatch.delenv("NONSMOOTH_CACHE", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "nonsmooth").mkdir()
    (tmp_path / "nonsmooth").chmod(0o777)
    assert build(SOURCE).answer() == 42
    assert mode(tmp_path / "nonsmooth") == 0o700


@pytest.mark.skipif(not hasattr(os, "ST_NOEXEC"), reason="another system")
def test_a_folder_from_which_nothing_can_be_run(cache, monkeypatch):
    class Noexec:
        f_flag = os.ST_NOEXEC if hasattr(os, "ST_NOEXEC") else 0

    monkeypatch.setattr(os, "statvfs", lambda path: Noexec)
    with pytest.warns(CompilerWarning, match="noexec"):
        assert build(SOURCE).answer() == 42


def no_home():
    raise RuntimeError("Could not determine home directory.")


def test_a_user_without_a_home_has_a_folder_for_the_process(monkeypatch):
    monkeypatch.delenv("NONSMOOTH_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    with pytest.warns(CompilerWarning, match="home"):
        assert isinstance(build(SOURCE), ctypes.CDLL)


HOMELESS = """
import grp, os, pwd, shutil, sys, warnings
sys.path[:0] = {path!r}
from nonsmooth.flow.engine.building import store
from nonsmooth.flow.engine.building.build import build
os.umask(0)
if os.geteuid() == 0:
    os.setgroups([])
    os.setgid(54321)
    os.setuid(54321)  # nobody's number
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    for number in (1, 2):
        assert build(f"int answer(void) {{{{ return {{number}}; }}}}").answer() == number
assert len(caught) == 1 and "for this process only" in str(caught[0].message), caught
folder = store.usable_folder()
assert os.stat(folder).st_mode & 0o777 == 0o700
print(folder)
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs another user")
def test_a_user_without_an_entry_in_passwd(tmp_path):
    environment = {"PATH": os.environ["PATH"], "TMPDIR": "/tmp"}
    program = HOMELESS.format(path=[p for p in sys.path if p])
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd="/", capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not os.path.exists(done.stdout.strip())  # it went with the process


def test_the_folder_of_a_mac_is_the_one_its_rules_name(monkeypatch, tmp_path):
    monkeypatch.delenv("NONSMOOTH_CACHE", raising=False)
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert store.cache_directory() == tmp_path / "Library" / "Caches" / "nonsmooth"


def test_a_folder_above_that_belongs_to_another_user_is_reported(cache, tmp_path, monkeypatch):
    give_away(tmp_path, monkeypatch)
    with pytest.warns(CompilerWarning, match="above.*user 12345"):
        assert build(SOURCE).answer() == 42


@pytest.mark.parametrize(
    ("name", "members", "primary", "private"),
    [
        ("ann", [], 100, True),
        ("ann", ["ann"], 100, True),
        ("ann", ["ann", "bob"], 100, False),
        ("staff", [], 100, False),
        ("ann", [], 20, False),
        (None, [], 100, False),
    ],
)
def test_a_group_is_private_if_it_is_named_after_its_only_member(
    name, members, primary, private, cache, tmp_path, monkeypatch
):
    """The folder above may be written by group 100; the user is ann."""
    import grp
    import pwd

    def group(number):
        if name is None:
            raise KeyError(number)
        return grp.struct_group((name, "x", number, members))

    def user(number):
        return pwd.struct_passwd(("ann", "x", number, primary, "", "/", ""))

    monkeypatch.setattr(grp, "getgrgid", group)
    monkeypatch.setattr(pwd, "getpwuid", user)
    above = tmp_path / "above"
    above.mkdir()
    above.chmod(0o775)
    monkeypatch.setenv("NONSMOOTH_CACHE", str(above / "cache"))
    give_away(above, monkeypatch, 5, 100)
    if private:
        assert store.usable_folder() == above / "cache"
    else:
        with pytest.warns(CompilerWarning, match="others"):
            assert store.usable_folder() != above / "cache"


def test_a_disk_that_takes_no_file_leaves_a_folder_for_the_process(cache, monkeypatch):
    def full(**options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store.tempfile, "TemporaryFile", full)
    with pytest.warns(CompilerWarning, match="No space left on device"):
        assert store.usable_folder() != cache


def test_without_any_place_for_files_the_error_says_what_to_set(cache, monkeypatch):
    def none(**options):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(store.tempfile, "TemporaryFile", none)
    monkeypatch.setattr(store.tempfile, "mkdtemp", none)
    store._own_folder.cache_clear()
    with (
        pytest.warns(CompilerWarning),
        pytest.raises(store.CompilerError, match=r"Read-only.*TMPDIR"),
    ):
        store.usable_folder()


def test_the_folder_of_the_process_is_removed_by_it_and_not_by_its_children(tmp_path):
    folder = tmp_path / "own"
    folder.mkdir()
    store._remove(folder, os.getpid() + 1)
    assert folder.is_dir()
    store._remove(folder, os.getpid())
    assert not folder.exists()
