"""`python -m nonsmooth` lists and shows the textbook, draws a run, and refuses unknown names."""

import copy
import pickle
import subprocess
import sys

import pytest

import nonsmooth as ns
from nonsmooth import textbook
from nonsmooth.__main__ import main


def test_list_names_every_problem(capsys):
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(textbook.PROBLEMS)
    assert all(len(line.split()) > 2 for line in lines)


def test_a_reader_that_has_enough_is_no_error():
    ours = subprocess.Popen(
        [sys.executable, "-m", "nonsmooth", "list"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    ours.stdout.close()  # as `head` does
    assert (ours.stderr.read(), ours.wait()) == (b"", 0)
    ours.stderr.close()


@pytest.mark.parametrize("name", textbook.PROBLEMS)
def test_show_prints_values_and_status(name, capsys):
    assert main(["show", name]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"{name}: ")
    for reference in textbook.by_name(name).references:
        assert reference.quantity in out
    assert "run: Trajectory(" in out


def test_version_and_names_near_a_wrong_one(capsys):
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == f"nonsmooth {ns.__version__}\n"
    assert main(["show", "stick_slip"]) == 2
    assert "Near it are" in (err := capsys.readouterr().err) and "leine_stick_slip" in err


def test_a_problem_survives_pickle_and_copy():
    problem = textbook.leine_stick_slip()
    for again in (pickle.loads(pickle.dumps(problem)), copy.deepcopy(problem)):
        assert dict(again.parameters) == dict(problem.parameters)
        assert again.system == problem.system


@pytest.mark.slow
def test_show_draws(tmp_path, capsys):
    pytest.importorskip("nonsmooth.plot")
    target = tmp_path / "run.png"
    assert main(["show", "dry_friction", "--out", str(target)]) == 0
    assert target.read_bytes()[:4] == b"\x89PNG"


def test_unknown_name_is_an_error_in_words(capsys):
    assert main(["show", "nosuch"]) == 2
    assert "called 'nosuch'" in capsys.readouterr().err


def test_it_is_a_command():
    done = subprocess.run(
        [sys.executable, "-m", "nonsmooth", "list"], capture_output=True, text=True, check=True
    )
    assert "bouncing_ball" in done.stdout
