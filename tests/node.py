"""Scripts of pages in Node, which has the WebAssembly of browsers: runs of systems by the shipped module."""

from __future__ import annotations

import json
import shutil
import subprocess
from typing import Any

import pytest

from nonsmooth.plot import driver
from nonsmooth.plot.offline_page import WEB

_RUNS = """
const given = JSON.parse(require("fs").readFileSync(0, "utf8"));
const { Engine } = require(given.engine);
(async () => {
  const bytes = await Engine.inflated(given.module);
  const answers = [];
  for (const { system, x, p, options } of given.cases) {
    system.image = await Engine.inflated(system.image);
    const engine = await Engine.load(bytes, system);
    const run = engine.simulate(x, p, options);
    answers.push({ ...run, x: [...run.x], eventT: [...run.eventT], eventX: null, eventAfterX: null,
      eventKind: [...run.eventKind], starts: null, coefficients: null, stepModes: null });
  }
  console.log(JSON.stringify(answers));
})();
"""


def node() -> str:
    """Path of Node, or skip with the reason."""
    found = shutil.which("node")
    if found is None:
        pytest.skip("no node on the PATH, which runs the WebAssembly of pages (Debian: nodejs)")
    return found


def script(text: str, given: object) -> Any:
    """What a script prints as JSON that reads ``given`` as JSON from its input."""
    done = subprocess.run(
        [node(), "-e", text], input=json.dumps(given), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def case(system: Any, x: Any, t_end: float, parameters: Any = None, tol: float = 1e-10) -> dict:
    """A run of a system as ``runs`` takes it."""
    return dict(
        system=driver.described(system, tol),
        x=[float(value) for value in x],
        p=system.parameter_vector(parameters).tolist(),
        options=dict(tEnd=float(t_end), tol=tol),
    )


def runs(cases: list[dict]) -> list[dict[str, Any]]:
    """Runs of the shipped module: status, itinerary, end, events."""
    engine = str(WEB / "engine.js")
    return script(_RUNS, dict(engine=engine, module=driver.module(), cases=cases))
