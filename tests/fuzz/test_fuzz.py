"""A minute of random problems and black boxes, and whether what judges them would see what is wrong."""

import casadi as ca
import numpy as np
import pytest
from fuzzing import FindingError, attempt_box, attempt_flight, check_flown
from random_flights import PlainPhase, PlainProblem
from random_terms import numeric, random_term, symbolic

from macs import sweep
from problems import Problem
from transcription import DFET


def test_terms_mean_the_same_to_both():
    rng = np.random.default_rng(0)
    for _ in range(200):
        term, values = random_term(rng, ["a", "b"], 3, 0.3), {"a": float(rng.normal()), "b": float(rng.normal())}
        symbols = {name: ca.MX.sym(name) for name in values}
        found = float(ca.Function("f", list(symbols.values()), [ca.MX(symbolic(term, symbols))])(*values.values()))
        try:
            ours = numeric(term, values)
        except ZeroDivisionError:
            continue
        assert found == pytest.approx(ours, rel=1e-12, abs=1e-300) or np.isnan(ours), "what is taken from itself may be 0 to CasADi"


@pytest.mark.slow
def test_other_code_sees_what_a_point_misses():
    problem = Problem("cart")
    drive = problem.phase("drive", t0=0.0, tf=(1.0, 5.0))
    x, u = drive.state("x", bounds=(-5, 5), initial=0.0, final=1.0), drive.control("u", bounds=(-1, 1))
    drive.dynamics(x=u - 0.1 * x)
    problem.minimize("time", drive.tf)
    problem.minimize("effort", drive.integral(u * u))
    (point, *_), front = (found := sweep(problem, DFET(3, 4), points=3)), found
    effort = ("square", ("name", "u"))

    def plain(drag: float, effort: tuple = effort, most: float = 1.0) -> PlainProblem:
        rates = {"x": ("-", ("name", "u"), ("*", ("number", drag), ("name", "x")))}
        phase = PlainPhase("drive", {"x": (-5.0, 5.0)}, {"u": (-1.0, most)}, rates, {"x": (1.0, 1.0)})
        return PlainProblem([phase], False, [("time", "minimize", "tf", phase, None), ("effort", "minimize", "integral", phase, effort)])

    assert point.verified
    check_flown(plain(0.1), point, front)
    for wrong, words in (
        (plain(0.2), "misses state drive.x"),
        (plain(0.1, ("number", 0.5)), "'effort' = "),
        (plain(0.1, most=0.1), "bounds"),
    ):
        with pytest.raises(FindingError, match=words):
            check_flown(wrong, point, front)


@pytest.mark.slow
def test_random_problems_have_true_points_or_clear_errors():
    assert "verified points" in {attempt_flight(seed) for seed in range(30)}


@pytest.mark.slow
def test_random_black_boxes_have_true_points_or_clear_errors():
    assert {"points", "refused"} <= {attempt_box(seed) for seed in range(200)}
