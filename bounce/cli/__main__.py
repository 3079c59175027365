"""``python -m bounce.cli`` is ``bounce``."""

import sys

from .main import main

sys.exit(main())
