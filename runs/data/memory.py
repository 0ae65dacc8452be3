"""Errors for want of memory, as numpy, CasADi and Python raise them."""

from __future__ import annotations

import sys
from contextlib import suppress


def is_memory_error(error: BaseException) -> bool:
    """Whether an error says that memory could not be allocated. CasADi's do so as RuntimeErrors, whose text ends with what C++ says."""
    return isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and "bad_alloc" in str(error))


def memory_message(error: BaseException) -> str:
    """One line on such an error: what was asked for, where it is known, what the process had, and what takes less."""
    had = ""
    with suppress(ImportError):  # only Unix has it
        import resource

        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
        had = f"; the process had {peak:.0f} MB"
    asked = " ".join(str(error).split())
    return f"out of memory{f': {asked}' if asked else ''}{had}; a coarser transcription, or fewer at a time, takes less"
