"""CasADi Functions compiled by the C compiler of this machine, where that works, and in limited time."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import casadi as ca

from ..stopping import stopping

SECONDS = 30.0
"""Time after which a compiler is taken to hang; the longest Functions that are compiled need a few seconds."""
BETWEEN = 0.05
"""Seconds between two looks at a compiler, and questions whether to end."""

log = logging.getLogger(__name__)
_useless: set[str] = set()
"""Commands that hung, or cannot be run, in this process."""


def compiler() -> str | None:
    """The C compiler of this machine that Functions are compiled with; None if they are not, or there is none that works."""
    if os.environ.get("MACS_COMPILE", "1") == "0":
        return None
    command = os.environ.get("CC", "").strip() or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    return None if command in _useless else command


def compiled_form(function: ca.Function) -> ca.Function | None:
    """The Function compiled; None where there is no compiler, it fails or hangs, or the work is to end early (`stopping`)."""
    command = compiler()
    if not command:
        return None
    try:
        with tempfile.TemporaryDirectory(prefix="macs_", ignore_cleanup_errors=True) as folder:
            generator = ca.CodeGenerator("compiled.c")
            try:
                generator.add(function)
                generator.generate(folder + os.sep)
            except RuntimeError as error:  # it has parts that are no C code, such as a Callback
                log.info("%s is not compiled: %s", function.name(), error)
                return None
            if not _run(command, Path(folder)):
                return None
            return ca.external(function.name(), str(Path(folder) / "compiled.so"))
    except (OSError, RuntimeError) as error:  # no folder for temporary files, or none from which a library can be loaded
        _give_up(command, str(error))
        return None


def _run(command: str, folder: Path) -> bool:
    """Compile compiled.c to compiled.so; False if the work is to end before. Raises OSError if there is no compiled.so then."""
    # Contracted or reordered operations would round differently.
    options = ["-shared", "-fPIC", "-O1", "-ffp-contract=off"]
    words = [*command.split(), *options, "compiled.c", "-o", "compiled.so", "-lm"]
    said = folder / "said.txt"
    with said.open("wb") as file:
        # In a session of its own, so that it ends with all processes that it started, and Ctrl-C is for this process alone.
        process = subprocess.Popen(
            words, cwd=folder, stdin=subprocess.DEVNULL, stdout=file, stderr=file, start_new_session=hasattr(os, "killpg")
        )
    began = time.monotonic()
    try:
        while process.poll() is None:
            if stopping():
                return False
            if time.monotonic() - began > SECONDS:
                raise TimeoutError(f"it did not end within {SECONDS:g} s")
            try:
                process.wait(BETWEEN)
            except subprocess.TimeoutExpired:
                continue
    finally:
        _end(process)
    if process.returncode != 0 or not (folder / "compiled.so").is_file():
        lines = said.read_text(errors="replace").strip().splitlines()
        raise OSError(f"it ended with {process.returncode}" + (f": {lines[-1]}" if lines else ""))
    return True


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the process, and those that it started, if it has not ended."""
    if process.poll() is None:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.wait()


def _give_up(command: str, reason: str) -> None:
    """Note that Functions stay interpreted from now on: a compiler that failed once would fail again."""
    _useless.add(command)
    log.warning("functions are not compiled, and take more time: %s: %s", command, reason)
