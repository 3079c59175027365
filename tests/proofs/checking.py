"""Runs of the checker, a program of its own, on saved proofs."""

import json
import subprocess
import sys
from pathlib import Path

CHECKER = Path(__file__).parents[2] / "checker"


def run(*paths):
    """Exit status and output for some files."""
    call = [sys.executable, "-I", str(CHECKER), *map(str, paths)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def checked(proof, path):
    """A proof in a file, and its check."""
    proof.save(path)
    return run(path)


def run_records(records, folder):
    path = folder / "records.json"
    path.write_text(json.dumps({"proofs": records}))
    return run(path)
