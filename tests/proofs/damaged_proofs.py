"""Damaged and crafted proofs: ``python -m tests.proofs.damaged_proofs COUNT [SEED]`` has the checker read that many.

A process of its own, since what is looked for may end it. It fails where the checker raises; a record that it works on
for more than two seconds is left (boxes are divided into thousands of pieces, by design).
"""

import contextlib
import importlib.util
import io
import json
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

import nonsmooth as ns
from tests.flow.damaged_files import JUNK, cut, flipped, replaced
from tests.proofs.checking import CHECKER
from tests.proofs.systems import BALL, PLANE, TEIXEIRA

MORE = (
    *("1e999999999", "1/0", "0.5", "-1/3", "power", "sin", "9" * 5000),
    *(["power", 0, 10**9], ["neg", 0]),
)


class LongError(BaseException):
    """The checker works for long."""


def originals():
    """Texts of saved proofs: a two-fold, a list of folds, a range in pieces, an orbit with impacts."""
    proofs = [
        ns.certify(ns.find_two_fold(TEIXEIRA, near=(0, 0.1, -0.1))),
        ns.prove_all(PLANE, [(-2, 2), (-1, 1)], "fold"),
        ns.certify_orbit(BALL, [1, 0], 2),
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "proof.json"
        texts = []
        for proof in proofs:
            proof.save(path)
            texts.append(path.read_text())
        return texts


def damaged(rng, text):
    """The text with other bytes, or the tree in it with other parts."""
    kind = rng.integers(6)
    if kind < 2:
        return (flipped, cut)[kind](rng, text.encode())
    tree = json.loads(text)
    for _ in range(rng.integers(1, 3)):
        replaced(rng, tree, (*JUNK, *MORE))
    text = json.dumps(tree)
    return (text.replace(": ", ": " + "[" * 10**5, 1) if rng.random() < 0.02 else text).encode()


def main(count, seed=0):
    sys.path.insert(0, str(CHECKER))
    spec = importlib.util.spec_from_file_location("checker_main", CHECKER / "__main__.py")
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    rng, texts, counts = np.random.default_rng(seed), originals(), Counter()

    def stop(*_):
        raise LongError

    signal.signal(signal.SIGALRM, stop)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "proof.json"
        for k in range(count):
            path.write_bytes(damaged(rng, texts[k % len(texts)]))
            signal.setitimer(signal.ITIMER_REAL, 2.0)
            words = io.StringIO()
            try:
                with contextlib.redirect_stdout(words):
                    code = program.main([str(path)])
                counts["checked" if code == 0 else "not checked"] += 1
                assert code == 0 or "NOT CHECKED" in words.getvalue()
            except LongError:
                counts["long"] += 1
            except BaseException:
                print(f"proof {k}, seed {seed}", file=sys.stderr)
                raise
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
    print(count, "proofs:", ", ".join(f"{name} {n}" for name, n in sorted(counts.items())))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
