"""The command line, `macs`."""

from .parser import main

__all__ = ["main"]
