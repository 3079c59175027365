"""The steps of the benchmark of a card, on its stand-in; each survives the failure of those before."""

import importlib.util
import json

import pytest

from benchmarks import gpu, report
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.engine.device.card import Card
from nonsmooth.flow.ensembles import on_device
from tests.flow.engine.device.test_card import Core


@pytest.fixture
def stand_in(monkeypatch):
    cards = {fused: Card(Core(), fused) for fused in (True, False)}
    monkeypatch.setattr(gpu, "card", lambda fused=True: cards[fused])
    monkeypatch.setattr(on_device, "machine_for", lambda device: cards[True])


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_steps(stand_in):
    for row in gpu.bits(quick=True).values():
        assert row["same bits"] == row["same itinerary"] == row["runs"] - row["to the driver"] > 0
    for row in gpu.agreement(quick=True).values():
        assert row["different itineraries"] == row["different statuses"] == 0
        assert row["largest difference"] < 1e-10 and row.get("events of one only", 0) == 0
    for row in gpu.starts(quick=True).values():
        assert row["same bits"] == row["runs"]
    for row in gpu.rates(quick=True).values():
        assert min(row["kernel"], row["outcomes"], row["ensemble"], row["steps of a run"]) > 1
    assert min(gpu.copies(quick=True).values()) > 1e6


@pytest.mark.skipif(importlib.util.find_spec("cuda") is not None, reason="cuda-core is there")
def test_a_step_that_fails_says_why(tmp_path, monkeypatch):
    monkeypatch.setattr(gpu, "STEPS", {name: gpu.STEPS[name] for name in ("card", "copies")})
    found = gpu.run(True, tmp_path)
    assert "cuda-core is missing" in found["card"]["failed"] and len(found) == 1
    assert json.loads((tmp_path / "gpu.json").read_text()) == found
    assert "cuda-core" in gpu.markdown(found, report.table)


def test_what_failed_is_shown_beside_what_did_not(tmp_path, monkeypatch):
    found = {
        "card": {"name": "a card", "driver, clock": "1"},
        "bits": {"failed": "one line\nand why"},
        "rates": {"linear": {"kernel": 1e9}},
        "copies": {"read": 2e9},
    }
    text = gpu.markdown(found, report.table)
    assert "bits: and why" in text and "| linear | 1,000,000,000 |" in text
    assert "agreement: not run" in text and "read 2,000,000,000" in text
    done = iter([found["card"], found["bits"], *[found["copies"]] * 9])
    monkeypatch.setattr(gpu, "_in_process", lambda name, quick: next(done))
    assert list(gpu.run(True, tmp_path)) == [*gpu.STEPS]
