"""What propagations and steps of Newton's method take, in iterations of IPOPT on the same program: from its sizes, so that it is the same
on all machines.

In instructions of the compiled functions an iteration of IPOPT takes those of the program's rows, several times for derivatives and the
line search, and what its linear algebra does for each entry of the Jacobian; whatever its size, a fixed part that is as long as so many
instructions. The constants are fitted to measured times of six problems, which they meet within a third (those of Newton's method on the
three on which its steps needed no least squares with signs).
"""

from __future__ import annotations

from problems.compiled import remembered

from ..base import NLP
from ..nlp.dense import too_dense
from ..numerics.batched import work

PASSES, FIXED, ENTRY = 6, 70_000, 22
"""Of an iteration of IPOPT: how often it goes through the program; its fixed part; for each entry of the Jacobian."""
CALL, STEP = 8_000, 20_000
"""Fixed parts of a propagation, and of a step of Newton's method."""


@remembered
def propagation(nlp: NLP) -> float:
    """Of a propagation whose objectives and constraints are evaluated."""
    return (nlp.reduced.instructions + CALL) / iteration(nlp)


@remembered
def evaluation(nlp: NLP) -> float:
    """Of an evaluation of the objectives and constraints alone."""
    return (work(nlp.functions) + CALL) / iteration(nlp)


@remembered
def newton_step(nlp: NLP) -> float:
    """Of a step of Newton's method, its propagation included."""
    return propagation(nlp) + (nlp.reduced.instructions_of_derivatives + STEP) / iteration(nlp)


@remembered
def iteration(nlp: NLP) -> float:
    """Instructions that take as long as an iteration of IPOPT: by these, programs of different kinds are comparable."""
    entries = nlp.dense if too_dense(nlp) else nlp.functions.jac_sparsity(1, 0).nnz()
    return PASSES * work(nlp.functions) + FIXED + ENTRY * entries
