"""Derivatives that are put together from those at points, beside CasADi's of the whole NLP."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from cases import oscillator
from euler import Euler

from macs import MACS
from problems import Problem, load
from transcription import DFET, NLP, Collocation, MultipleShooting, SingleShooting
from transcription.inner import Ipopt, Newton
from transcription.nlp import derivatives, from_points
from transcription.nlp.derivatives import gradients, hessian, linear_objectives, objective_gradients
from transcription.nlp.from_points import FromPoints
from transcription.phases.mesh import PhaseMesh


def everything() -> Problem:
    """Two branches that meet in a third phase: what an NLP may consist of, and nothing linear where it need not be."""
    problem = Problem("everything")
    p = problem.parameter("p", bounds=(0.5, 2))
    phases = []
    for name, begin in (("left", (0.0, 0.5)), ("right", (0.0, 0.5)), ("last", (1.0, 3.0))):
        phase = problem.phase(name, t0=begin, tf=(1.0, 3.0) if name != "last" else (2.0, 5.0), duration=(0.2, 2.5))
        x, y = phase.state("x", bounds=(-3, 3), initial=(-1, 1) if name != "last" else None), phase.state("y", bounds=(-3, 3))
        u, turn = phase.control("u", bounds=(-1, 1)), phase.control("turn", bounds=(-np.pi, np.pi), period=2 * np.pi)
        table = ca.interpolant(f"table_{name}", "bspline", [np.linspace(-4, 4, 9).tolist()], np.sin(np.linspace(-4, 4, 9)).tolist())
        phase.dynamics(x=y * ca.cos(turn) + p * phase.tf * ca.sin(phase.time), y=u * x**2 - p * ca.sin(turn) + table(y))
        phase.path("inequality", x * u + phase.time * p, upper=5)
        phase.path("equality", u**2 + ca.sin(turn) * y, lower=0.3, upper=0.3)
        phases.append(phase)
    left, right, last = phases
    problem.link(left, last)
    problem.link(right, last)
    x, y = last["x"], last["y"]
    work, size = left.integral(left["u"] ** 2 * left["x"] * p), last.integral(ca.fabs(last["u"] * x))
    problem.constraint("product", work * right.final(right["x"] * right["u"]) * left.t0, upper=4)
    problem.constraint("peak", last.peak(x * y + last.time), upper=9)
    problem.minimize("sum", work**2 + size + ca.exp(last.final(x * y)) * last.initial(y * last["u"]) * p)
    problem.minimize("end", last.tf)
    return problem


def smooth() -> Problem:
    """With what CasADi cannot write as scalar operations, and a mesh that moves."""
    problem = oscillator()
    problem.constraint("both", problem.phases["swing"].final(problem.phases["swing"]["x"] ** 2) * problem.parameters["m"], upper=9)
    return problem


def designed() -> Problem:
    """Two phases of a vehicle whose size takes more operations than its motion."""
    problem = Problem("designed")
    a, b = (problem.parameter(name, bounds=(0.5, 2)) for name in "ab")
    area, volume = ca.sqrt(a**3 + ca.sin(b) ** 2) * ca.exp(-a * b), ca.log(1 + a**2 * b) * ca.tanh(a - b) + ca.cos(a * b)
    phases = []
    for name, begin in (("up", 0.0), ("down", (0.5, 3.0))):
        phase = problem.phase(name, t0=begin, tf=(0.5, 3.0) if name == "up" else (2.0, 5.0))
        x, v = phase.state("x", bounds=(-3, 3), initial=1.0 if name == "up" else None), phase.state("v", bounds=(-3, 3))
        u = phase.control("u", bounds=(-1, 1))
        phase.dynamics(x=v, v=u - area * v**2 * ca.sin(x) - volume * x + a)
        phase.path("load", area * ca.exp(x) * v, upper=5)
        phases.append(phase)
    problem.link(*phases)
    problem.constraint("size", area * volume + phases[1].integral(phases[1]["u"] ** 2 * volume), upper=9)
    problem.minimize("end", phases[1].tf * volume)
    problem.minimize("area", area)
    return problem


CASES = {
    "everything": (everything, DFET(2, 2)),
    "everything, Bernstein": (everything, DFET(2, 3, control_order=1, basis="bernstein")),
    "a design in common": (designed, DFET(3, 2)),
    "a design in common, moving edges": (designed, DFET(2, 2, mesh={"up": ((0.0, 0.2, 0.4, 1.0), 2, None, (1, 2))})),
    "constants": (oscillator, DFET(1, 0)),
    "moving edges": (smooth, DFET(2, 2, mesh={"swing": ((0.0, 0.1, 0.35, 0.6, 1.0), 3, None, (1, 3))})),
    "arcs": (smooth, DFET(2, 2, mesh={"swing": PhaseMesh((0.0, 0.3, 0.6, 1.0), 2, None, (1,), (("u", (0,)),))})),
    "tables": (lambda: load("standard/climb"), DFET(3, 2)),
    "four phases": (lambda: load("standard/delta_iii"), DFET(2, 2)),
    "quotients of integrals": (lambda: load("standard/isoperimetric"), DFET(3, 2)),
}


def somewhere(nlp: NLP, k: int = 3) -> np.ndarray:
    """Vectors (k, n) inside of the bounds."""
    lower, upper = (np.where(np.isfinite(side), side, other) for side, other in ((nlp.lower, -nlp.scale), (nlp.upper, nlp.scale)))
    return lower + np.random.default_rng(1).uniform(0.2, 0.8, (k, len(lower))) * (upper - lower)


def gap(one: ca.DM, other: ca.DM) -> float:
    """Largest difference, relative to the largest entry."""
    a, b = np.array(ca.DM(one)), np.array(ca.DM(other))
    assert a.shape == b.shape and np.isfinite(b).all() and np.abs(b).max(initial=0.0) > 0
    return float(np.abs(a - b).max() / np.abs(b).max())


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_derivatives_from_points_are_those_of_the_whole(case):
    problem, method = CASES[case]
    nlp = method.transcribe(problem())
    assert nlp.parts is not None
    whole, rng = replace(nlp, parts=None), np.random.default_rng(2)
    for z in somewhere(nlp):
        for one, other in zip(gradients(nlp)(z), gradients(whole)(z), strict=True):
            assert gap(one, other) < 1e-13
        assert gap(objective_gradients(nlp)(z), objective_gradients(whole)(z)) < 1e-13
        weights = rng.standard_normal(len(nlp.problem.goals)), rng.standard_normal(len(nlp.g_scale))
        assert gap(hessian(nlp)(z, *weights), hessian(whole)(z, *weights)) < 1e-12


@pytest.mark.parametrize("case", CASES)
def test_they_are_as_sparse(case):
    """But for points at the ends of a phase, where a derivative by one of its times may be zero."""
    problem, method = CASES[case]
    nlp = method.transcribe(problem())
    for function, i in ((gradients, 0), (gradients, 1), (hessian, 0)):
        own, other = (function(one).sparsity_out(i).nnz() for one in (nlp, replace(nlp, parts=None)))
        assert 0 < own <= 1.02 * other


@pytest.mark.parametrize("method", [DFET(3, 2), Collocation(3, 2), MultipleShooting(3)])
def test_which_objectives_are_linear(method):
    """Against slopes at two places; and what is linear in all but one variable is not. With tables, shooting shows some or none."""
    problem = everything()
    x, t0 = problem.phases["left"]["x"], problem.phases["left"].t0
    problem.minimize("mixed", 2 * problem.phases["last"].tf - t0)
    problem.minimize("state", problem.phases["left"].initial(x) + 3)
    problem.minimize("product", problem.parameters["p"] * t0)
    problem.minimize("nearly", problem.phases["left"].tf + 1e-9 * problem.parameters["p"] ** 2)
    nlp = method.transcribe(problem)
    one, other = (np.array(objective_gradients(nlp)(z)) for z in somewhere(nlp)[:2])
    linear = (one == other).all(axis=1)
    assert linear.tolist() == [False, True, True, True, False, False]
    assert np.array_equal(linear_objectives(nlp), linear) or (nlp.parts is None and not (linear_objectives(nlp) & ~linear).any())
    assert linear_objectives(method.transcribe(load("goddard"))).all()


def test_a_design_is_derived_once_for_all_points(monkeypatch):
    """Its derivatives are then none of those at points, which take fewer operations."""

    def operations() -> int:
        points = FromPoints(nlp, nlp.parts)._points
        return sum(one.slopes.n_instructions() + one.curvature()[0].n_instructions() for one in points)

    nlp = DFET(3, 2).transcribe(designed())
    once = operations()
    monkeypatch.setattr(from_points, "SHARED_PART", np.inf)
    assert once < 0.5 * operations()


@pytest.mark.parametrize("method", [Euler(5), MultipleShooting(3)])
def test_methods_without_parts_have_derivatives_of_the_whole(method):
    nlp = method.transcribe(oscillator())
    assert nlp.parts is None
    z, step = somewhere(nlp, 1)[0], 1e-6
    found = np.array(ca.DM(gradients(nlp)(z)[1]))
    columns = [(np.array(nlp.functions(z + step * e)[1]) - np.array(nlp.functions(z - step * e)[1])) / (2 * step) for e in np.eye(len(z))]
    assert np.abs(found - np.hstack(columns)).max() < 1e-6 * max(1.0, np.abs(found).max())


def test_as_many_are_counted_as_there_are_and_more_than_memory_holds_are_refused(monkeypatch):
    for nodes in (50, 100, 200):
        nlp = SingleShooting(nodes).transcribe(load("goddard"))
        there = nlp.functions.jac_sparsity(1, 0).nnz()
        assert 0.8 * there < nlp.dense < 1.2 * there
    assert DFET(50, 2).transcribe(load("goddard")).dense == 0
    # As if there were memory for few derivatives only: those of some 20 nodes.
    monkeypatch.setattr(derivatives, "MOST_GIGABYTES", 1e-4)
    many, *others = (method.transcribe(load("goddard")) for method in (SingleShooting(100), MultipleShooting(100), SingleShooting(15)))
    for derive in (gradients, objective_gradients, hessian):
        with pytest.raises(ValueError, match=r"'goddard', SingleShooting\(nodes=100\): .* GB, more than 0.0001 GB.* MultipleShooting"):
            derive(many)
        for nlp in others:
            derive(nlp)
    for inner in (Newton(), Ipopt()):
        with pytest.raises(ValueError, match="inner='propagate'"):
            inner.solve(many, 0.5 * (many.lower + many.upper)[many.free][None])
    front = MACS().solve(load("goddard"), SingleShooting(100), evaluations=40, seed=1, inner="propagate")
    assert front.stats["evaluations"] == 40 and front.stats["gradient_solves"] == 0
