"""`python -m runs.cli.parser`."""

import sys

from .parser import main

sys.exit(main())
