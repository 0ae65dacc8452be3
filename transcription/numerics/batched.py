"""CasADi Functions called for many columns at once: without copies, and compiled by the C compiler of this machine once that pays."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from problems.externals import reraise
from problems.layers import calls_externals, mapped

from ..stopping import stopping

COMPILER_SECONDS = 30.0
"""Time after which a compiler is taken to hang; the longest Functions that are compiled need a few seconds."""

log = logging.getLogger(__name__)
_useless: set[str] = set()
"""Commands that hung, or cannot be run, in this process."""
LONGEST_COMPILED = 20_000
"""Most instructions of a Function that is compiled: a compiler's time grows faster than they do."""
BLOCK = 64
"""Most calls at once: each number of them needs a Function of its own."""
WORTH_A_BLOCK = 24
"""Calls of a block of so many from which on all of them, by a wide Function, take less time."""
COSTLY = {ca.OP_SIN, ca.OP_COS, ca.OP_TAN, ca.OP_ASIN, ca.OP_ACOS, ca.OP_ATAN, ca.OP_ATAN2, ca.OP_SINH, ca.OP_COSH, ca.OP_TANH}
COSTLY |= {ca.OP_EXP, ca.OP_LOG, ca.OP_POW, ca.OP_CONSTPOW, ca.OP_ERF}
"""Operations that take some tens of times as long as a sum."""
# An instruction: compiled, more if it is costly, not compiled; a rootfinder, in times of its residual with derivatives.
PRICES = {"compiled": 0.35, "costly": 10.0, "interpreted": 2.6, "root": 12}
# A batch of candidates, each of them, each number of its variables and rows; Newton's method: steps of a batch, each of them.
PRICES |= {"batch": 500_000, "candidate": 40_000, "number": 60, "steps": 250_000, "step": 50_000}
# A gradient solve, an iteration of IPOPT, an entry of its matrix, an instruction of its derivatives.
PRICES |= {"solve": 15_000_000, "iteration": 400_000, "entry": 100, "derivative": 10}
"""Nanoseconds of one processor for each kind of work, fitted to its times (`macs bench charges`), which make different work comparable."""
CHAIN = "chain"
"""Name of a Function of so many repetitions that it, and all that it is a part of, is not to be written out."""


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
            if time.monotonic() - began > COMPILER_SECONDS:
                raise TimeoutError(f"it did not end within {COMPILER_SECONDS:g} s")
            try:
                process.wait(0.05)
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


class Batched:
    """A Function of dense inputs, for arrays with one row for each call.

    Where a C compiler is present, a Function that has worked enough is compiled. The compiled one does the same operations in the same
    order; it is taken only if it gives the same bits on the batch at hand. Set the environment variable MACS_COMPILE to 0 to never compile,
    to "always" to compile at the first call.
    """

    def __init__(self, function: ca.Function, *, compiled: bool = True, wide: Callable[[int], ca.Function] | None = None) -> None:
        self._function, self._wide = function, wide
        self._sizes = [function.nnz_out(i) for i in range(function.n_out())]
        self._blocks: dict[int, tuple[Any, Callable[[], None]]] = {}
        self._width = 0
        self._may_compile = compiled and compiler() is not None and not calls_externals(function)
        # Instructions done, some tenths of a second of CasADi's virtual machine, after which a Function of 1500 is worth compiling.
        self._pays = 0 if os.environ.get("MACS_COMPILE") == "always" else 30_000_000
        self._work, self.instructions, self._length = 0, work(function), _length(function)
        self.calls, self._charged = 0, (function, compiled and self._length <= LONGEST_COMPILED and not calls_externals(function))

    def __call__(self, *inputs: np.ndarray) -> list[np.ndarray]:
        """Outputs (k, nonzeros of each) for k calls.

        Every input has what the calls take one after the other, column by column: its leading axis is k, or a multiple of it.
        """
        k = len(inputs[0])
        arrays = [np.ascontiguousarray(values, dtype=float) for values in inputs]
        outputs = self._evaluate(arrays, k)
        self._work, self.calls = self._work + k * self.instructions, self.calls + k
        if self._may_compile and self._work * 1500 > self._pays * max(self._length, 1500):
            self._compile(arrays, outputs)
        return outputs

    @cached_property
    def nanoseconds(self) -> int:
        """What is charged for a call, whether or not there is a compiler here."""
        return round(_nanoseconds(*self._charged, {}))

    def _evaluate(self, arrays: list[np.ndarray], k: int) -> list[np.ndarray]:
        if self._wide and not self._width and k >= WORTH_A_BLOCK:
            self._width = -(-k // -(-k // BLOCK))
        most = self._width or BLOCK
        if self._wide and k % most and k % most * BLOCK >= WORTH_A_BLOCK * most:
            # Fill the last block up, and leave out what is too much again.
            filled = [np.concatenate([values, np.repeat(values[-len(values) // k :], most - k % most, axis=0)]) for values in arrays]
            return [values[:k] for values in self._evaluate(filled, k + most - k % most)]
        outputs = [np.empty((k, size)) for size in self._sizes]
        for first in range(0, k, most):
            last = min(first + most, k)
            buffer, evaluate = self._block(last - first)
            for i, values in enumerate(arrays):
                if values.size:
                    share = len(values) // k
                    buffer.set_arg(i, values[first * share : last * share].data)
            for i, values in enumerate(outputs):
                if values.size:
                    buffer.set_res(i, values[first:last].data)
            evaluate()
            reraise()
            if buffer.ret():
                raise RuntimeError(f"{self._function.name()} failed")
        return outputs

    def _block(self, size: int) -> tuple[Any, Callable[[], None]]:
        if size not in self._blocks:
            wide = self._wide if size == self._width else None
            self._blocks[size] = (self._function if size == 1 else wide(size) if wide else mapped(self._function, size)).buffer()
        return self._blocks[size]

    def _compile(self, arrays: list[np.ndarray], expected: list[np.ndarray]) -> None:
        """Replace the Function by its compiled form, if there is one and it agrees to the last bit."""
        self._may_compile = False
        if self._length > LONGEST_COMPILED:
            return
        interpreted = self._function, self._blocks, self._wide, self._width
        library = compiled_form(self._function)
        if library is None:
            return
        self._function, self._blocks, self._wide, self._width = library, {}, None, 0
        found = self._evaluate(arrays, len(arrays[0]))
        if not all(np.array_equal(a, b, equal_nan=True) for a, b in zip(found, expected, strict=True)):
            self._function, self._blocks, self._wide, self._width = interpreted
            log.info("%s: compiled values differ in the last bits; it stays interpreted", self._function.name())


def work(function: ca.Function) -> int:
    """Instructions that one call goes through, as often as it does; none of what is not made of instructions."""
    if function.is_a("SXFunction"):
        return function.n_instructions()
    if function.is_a("Map"):
        information = function.info()
        return information["n"] * work(information["f"])
    if not function.is_a("MXFunction"):
        return 0
    calls = (i for i in range(function.n_instructions()) if function.instruction_id(i) == ca.OP_CALL)
    return function.n_instructions() + sum(work(function.instruction_MX(i).which_function()) for i in calls)


def _nanoseconds(function: ca.Function, compiled: bool, known: dict[int, float]) -> float:
    """What is charged for one call of a Function, from its instructions alone; `known` of its parts."""
    if function.is_a("Map"):
        information = function.info()
        return information["n"] * _nanoseconds(information["f"], compiled, known)
    flat = function.is_a("SXFunction")
    if not flat and not function.is_a("MXFunction"):
        return PRICES["root"] * sum(_nanoseconds(part, compiled, known) for part in function.find_functions())
    if (key := hash(function)) not in known:
        count = function.n_instructions()
        kinds = [function.instruction_id(i) for i in range(count)] if compiled or not flat else []
        costly = PRICES["costly"] * sum(kind in COSTLY for kind in kinds)
        parts = [function.instruction_MX(i).which_function() for i, kind in enumerate(kinds) if not flat and kind == ca.OP_CALL]
        own = PRICES["compiled"] * count + costly if compiled else PRICES["interpreted"] * count
        known[key] = own + sum(_nanoseconds(part, compiled, known) for part in parts)
    return known[key]


def _length(function: ca.Function) -> int:
    """Instructions to be compiled: those of each Function that has a part in it, once."""
    parts = [function, *function.find_functions()]
    return sum(part.n_instructions() for part in parts if part.is_a("SXFunction") or part.is_a("MXFunction"))


def widened(function: ca.Function, k: int) -> ca.Function:
    """k calls of a Function at once, operation by operation: to the last bit what k calls give."""
    symbols = [ca.MX.sym(f"i{i}", k, function.numel_in(i)) for i in range(function.n_in())]
    entries = [ca.horzsplit(symbol) if symbol.numel() else [] for symbol in symbols]
    found: list[list[ca.MX]] = [[ca.MX()] * function.numel_out(i) for i in range(function.n_out())]
    memory: dict[int, ca.MX] = {}
    for i in range(function.n_instructions()):
        operation, out, of = function.instruction_id(i), function.instruction_output(i), function.instruction_input(i)
        if operation == ca.OP_INPUT:
            memory[out[0]] = entries[of[0]][of[1]]
        elif operation == ca.OP_OUTPUT:
            value = memory[of[0]]
            found[out[0]][out[1]] = value if value.numel() == k else ca.repmat(value, k, 1)
        elif operation == ca.OP_CONST:
            memory[out[0]] = ca.MX(function.instruction_constant(i))
        elif len(of) == 1:
            memory[out[0]] = ca.MX.unary(operation, memory[of[0]])
        else:
            memory[out[0]] = ca.MX.binary(operation, memory[of[0]], memory[of[1]])
    return ca.Function(function.name(), symbols, [ca.densify(ca.horzcat(ca.MX(k, 0), *columns)) for columns in found])


def chained(function: ca.Function, n: int) -> ca.Function:
    """n calls one after the other, as by `Function.mapaccum`, in which externals stay visible."""
    if not calls_externals(function):
        return function.mapaccum(f"{function.name()}s", n)
    state, *others = (
        ca.MX.sym(function.name_in(i), function.size1_in(i), function.size2_in(i) * (n if i else 1)) for i in range(function.n_in())
    )
    results, parts = [[state]], [ca.horzsplit(one, one.shape[1] // n) for one in others]
    for inputs in zip(*parts, strict=True):
        results.append(function.call([results[-1][0], *inputs], True, False))
    return ca.Function(f"{function.name()}s", [state, *others], [ca.horzcat(*one) for one in zip(*results[1:], strict=True)])


def expanded(function: ca.Function) -> ca.Function:
    """The function as a flat list of scalar operations, several times faster, where its parts allow that. Externals do not: they would be
    called point by point."""
    if calls_externals(function) or any(part.name() == CHAIN for part in function.find_functions()):
        return function
    try:
        return function.expand()
    except RuntimeError:
        return function
