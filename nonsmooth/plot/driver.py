"""The library's driver in a page: its WebAssembly module, and systems as data."""

from __future__ import annotations

import base64
import gzip
from functools import lru_cache
from itertools import accumulate
from typing import Any

from ..flow.constants import FULL, GUARDS, IMPLICIT_STEP, KINDS
from ..flow.engine.building.build import CompilerError
from ..flow.engine.building.webassembly import MODULE, has_module_key
from ..flow.engine.image import exchanged, image_of
from ..flow.engine.interpreter import interpreter_for
from ..flow.engine.recording import written_arrays
from ..flow.options import Options
from ..model import FilippovSystem


@lru_cache(maxsize=1)
def module() -> str:
    """The module, compressed, as text; CompilerError in a checkout whose driver has changed since."""
    if not has_module_key(content := MODULE.read_bytes()):
        raise CompilerError(
            f"{MODULE.name} was compiled from other sources of the driver. Run `make wasm`."
        )
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


def described(system: FilippovSystem, tol: float = 1e-10) -> dict[str, Any]:
    """A system for ``Engine`` of engine.js: its image, its sizes, and how its modes are spelled."""
    system = system.of_breakpoints
    engine = interpreter_for(system, Options(t_end=1.0, rtol=tol, atol=tol))
    image = image_of(engine)
    layouts = exchanged()
    machine = dict(
        layout=layouts,
        arrays=written_arrays(),
        full=FULL,
        implicit=IMPLICIT_STEP,
        kinds=list(KINDS),
        guards=len(GUARDS),
    )
    driven, tables = engine.system, engine.shown.tables  # a table is one function of the driver
    m, contacts, discrete = (
        driven.surface_count,
        len(driven.impacts),
        len(driven.definition.discrete),
    )
    names = system.state_names
    return dict(
        machine=machine,
        image=base64.b64encode(gzip.compress(bytes(image.bytes), 9, mtime=0)).decode(),
        addresses=image.addresses,
        tol=tol,
        order=engine.order,
        states=list(names),
        parameters=list(system.parameter_names),
        cells=len(driven.parameter_names) - len(system.parameter_names),
        dimension=system.dimension,
        n=system.extended_dimension,
        m=m,
        c=contacts,
        atoms=engine.atoms,
        entries=[members[0] for members in driven.entries],
        half_lines=list(driven.half_lines),
        tables=[_table(table) for table in tables],
        discrete=names[system.dimension - discrete :] if discrete else [],
        mode_width=m + contacts + 8 * (discrete + len(tables)),
        motion=engine.motion_width,
        named=max(map(len, (system.stops, system.resets))) + m + contacts + 1,
    )


def _table(table: Any) -> dict[str, Any]:
    """A table: its function, how many breakpoints are shown, and how many of them are below each cell."""
    below = [*accumulate([i >= 0 for i in table.shown], initial=0)]
    return dict(element=table.element, count=table.count, below=below)
