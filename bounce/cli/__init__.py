"""The command line: ``bounce launch``, ``land``, ``map``, ``fit``, ``models`` and ``explore``.

Exit codes: 0 done, 1 a computation or a file failed, 2 wrong arguments, 3 a fit whose data do not
determine a parameter.
"""

from .choices import CONTACT_MODELS
from .main import main

__all__ = ["CONTACT_MODELS", "main"]
