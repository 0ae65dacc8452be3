"""Work that is to end early: what was solved comes back, the rest is a timeout."""

import numpy as np
import pytest
from cases import candidates

from macs import sweep
from problems import load
from transcription import DFET
from transcription.inner import Ipopt, Projection
from transcription.nlp.scalarized import scalarize
from transcription.stopping import Stopped, check_stopping, stopped_by, stopping


def after(solves: int):
    """Asks to stop after so many questions."""
    asked = iter(range(10**6))
    return lambda: next(asked) >= solves


def test_only_within_and_only_if_asked():
    assert not stopping()
    with stopped_by(lambda: True):
        assert stopping()
        with stopped_by(lambda: False):
            assert stopping(), "work that is a part of other work ends with it"
    with stopped_by(lambda: False):
        assert not stopping()
        with stopped_by(lambda: "time limit"), pytest.raises(Stopped, match=r"^time limit$"):
            check_stopping()
        check_stopping()
    with pytest.raises(KeyError), stopped_by(lambda: True):
        raise KeyError
    assert not stopping()


def test_ipopt_leaves_the_rest_of_a_batch():
    nlp = DFET(3, 2).transcribe(load("goddard"))
    C = candidates(nlp, 5)
    whole = Ipopt().solve(nlp, C)
    with stopped_by(after(2)):
        part = Ipopt().solve(nlp, C)
    assert part.status.tolist() == ["converged"] * 2 + ["timeout"] * 3 and part.clocked
    assert np.array_equal(part.z[:2], whole.z[:2]) and (part.violation[2:] > 1e-6).all()
    near = np.clip(whole.z[:, nlp.free] + 1e-3, nlp.lower[nlp.free], nlp.upper[nlp.free])
    with stopped_by(lambda: True):
        cut = Projection().solve(nlp, near, whole.z)
    assert set(cut.status) == {"timeout"} and cut.clocked and set(cut.iterations) == {1} and not cut.fallbacks


def test_gradient_solves_end_with_what_they_have():
    nlp = DFET(3, 2).transcribe(load("goddard"))
    start = Projection().solve(nlp, candidates(nlp, 1)).z[0]
    with stopped_by(lambda: True):
        solved = scalarize(nlp, start, reference=np.zeros(2), weights=np.ones(2))
    assert solved.status == "timeout" and solved.clocked and not solved.begun and np.array_equal(solved.z, start)
    with stopped_by(after(16)):
        part = sweep(load("goddard"), DFET(3, 2), points=10, starts=1)
    # Of the 16 questions, building programs asks some: what is left is enough for five solves.
    assert 0 < len(part) < 10 and part.stats["gradient_solves"] >= 4 and not part.stats["reproducible"]
    assert part.stats["failures"]["timeout"] > 0 and (part.status == "converged").all()
