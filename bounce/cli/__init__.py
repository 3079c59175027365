"""The command line: ``bounce shot``, ``flight``, ``map``, ``fit``, ``models`` and ``explore``.

Exit codes: 0 done, 1 it could not be computed or read, 2 it was asked for wrongly, 3 a fit was
computed, and its data do not determine a parameter.
"""

from .choices import CONTACT_MODELS
from .main import main

__all__ = ["CONTACT_MODELS", "main"]
