"""The library of the driver: that of the installed wheel, or compiled on first use and kept in the cache."""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

from .building.build import build, has_key
from .building.core_source import core_source, packaged_name, source_key

_PACKAGED = Path(__file__).with_name(packaged_name(sys.platform))


def core_library() -> ctypes.CDLL:
    """Load the driver; CompilerError where a checkout has no compiler."""
    try:
        if has_key(loaded := ctypes.CDLL(str(_PACKAGED)), source_key()):
            return loaded
    except OSError:
        pass  # a checkout, or a wheel of another machine
    return build(core_source())
