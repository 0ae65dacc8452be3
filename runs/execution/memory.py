"""Peak memory of a process, and errors for want of memory, as numpy, CasADi and Python raise them."""

from __future__ import annotations

import math
import sys
from pathlib import Path


def is_memory_error(error: BaseException) -> bool:
    """Whether an error says that memory could not be allocated. CasADi's do so as RuntimeErrors, whose text ends with what C++ says."""
    return isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and "bad_alloc" in str(error))


def memory_message(error: BaseException) -> str:
    """One line on such an error: what was asked for, where it is known, what the process had, and what takes less."""
    peak = peak_memory()
    had = "" if math.isnan(peak) else f"; the process had {peak:.0f} MB"
    asked = " ".join(str(error).split())
    return f"out of memory{f': {asked}' if asked else ''}{had}; a coarser transcription, or fewer at a time, takes less"


def peak_memory() -> float:
    """Most memory that this process has had, MB; no number where the system does not say."""
    status = Path("/proc/self/status")
    # On Linux, what `getrusage` says of a process is at least what the one that started it had.
    for line in status.read_text().splitlines() if status.exists() else ():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) / 2**10
    try:
        import resource
    except ImportError:  # only Unix has it
        return math.nan
    # Kilobytes, but bytes on a Mac.
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
