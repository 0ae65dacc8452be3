"""`python -m runs.cli`."""

import sys

from .parser import main

sys.exit(main())
