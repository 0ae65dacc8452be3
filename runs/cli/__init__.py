"""The command line, `macs`."""

from .answers import ended_at_once

# Ctrl-C while the parser is imported, too, is one line and no traceback.
with ended_at_once("macs"):
    from .parser import main

__all__ = ["main"]
