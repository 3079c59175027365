"""The command line, as its tests call it."""

import pytest

from bounce.cli import main


@pytest.fixture
def command(capsys):
    """Run a command: exit code, what it prints, and what it says on the side."""

    def run(*argv):
        code = main([str(a) for a in argv])
        out = capsys.readouterr()
        return code, out.out, out.err

    return run
