"""The library's driver in a page: its WebAssembly module, and systems as data."""

from __future__ import annotations

import base64
import gzip
from functools import lru_cache
from typing import Any

from ..flow.constants import FULL, GUARDS, IMPLICIT_STEP, KINDS
from ..flow.engine.building.build import CompilerError
from ..flow.engine.building.webassembly import MODULE, has_module_key
from ..flow.engine.image import exchanged, image_of
from ..flow.engine.recording import written_arrays
from ..flow.engine.tape import tape_for
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
    engine = tape_for(system, Options(t_end=1.0, rtol=tol, atol=tol))
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
    contacts, discrete = len(system.impacts), len(system.definition.discrete)
    names = system.state_names
    return dict(
        machine=machine,
        image=base64.b64encode(gzip.compress(bytes(image.bytes), 9, mtime=0)).decode(),
        places=image.places,
        tol=tol,
        order=engine.order,
        states=list(names),
        parameters=list(system.parameter_names),
        dimension=system.dimension,
        n=system.extended_dimension,
        m=system.surface_count,
        c=contacts,
        atoms=engine.atoms,
        entries=[members[0] for members in system.entries],
        half_lines=list(system.half_lines),
        discrete=names[system.dimension - discrete :] if discrete else [],
        mode_width=system.surface_count + contacts + 8 * discrete,
        motion=engine.motion_width,
        named=max(map(len, (system.entries, system.stops, system.resets)))
        + system.surface_count
        + contacts
        + 1,
    )
