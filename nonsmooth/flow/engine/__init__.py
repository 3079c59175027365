"""Python around the driver in C (``flow/core``) and the lanes in C (``flow/kernel``).

``interpreter`` gives the driver a system as data, ``arrays`` its options and arrays; ``convert`` makes a Trajectory of a
run. ``lanes`` and ``device`` run many trajectories; ``building`` compiles and stores libraries.
``docs/decisions/one_driver.md`` lists the files of ``core`` by task.
"""

from .arrays import Run
from .building.build import CompilerError, find_compiler
from .interpreter import Interpreter, interpreter_for
from .lanes import Lanes, lanes_for
