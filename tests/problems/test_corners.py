"""Where tables of time have corners, and that meshes have edges there."""

import casadi as ca
import numpy as np
import pytest

from macs import optimize
from macs.refinement.mesh_search import coarse_meshes
from problems import Problem

KNOTS = (-1.0, 0.25, 0.7, 2.0, 3.9, 5.0, 6.0)


def follow(expr, t0=0.0, tf=5.0) -> Problem:
    """A control that follows a signal, exactly if it may have corners where that has them."""
    problem = Problem("follow")
    phase = problem.phase("run", t0=t0, tf=tf)
    phase.state("x", bounds=(-50, 50), initial=0.0)
    u = phase.control("u", bounds=(-5, 5))
    phase.dynamics(x=u)
    problem.minimize("miss", phase.integral((u - expr(phase)) ** 2))
    return problem


def table(kind="linear", knots=KNOTS):
    return ca.interpolant("table", kind, [knots], np.sin(np.arange(len(knots)) ** 2))


@pytest.mark.parametrize(
    ("expr", "expected"),
    [
        (lambda phase: table()(phase.time), (0.25, 0.7, 2.0, 3.9)),
        (lambda phase: table()(2 * phase.time - 1) + phase["x"], (0.625, 0.85, 1.5, 2.45, 3.0)),
        (lambda phase: ca.if_else(3 * phase.time < 2, 1, phase["x"]), (2 / 3,)),
        (lambda phase: ca.fabs(phase.time - 1) + table("bspline")(phase.time), ()),
        (lambda phase: table()(phase["x"] + phase.time), ()),
        (lambda phase: table(knots=np.linspace(-1, 6, 300))(phase.time), ()),
    ],
    ids=["a table", "of another measure", "a switch", "smooth", "of a state", "too many"],
)
def test_the_corners_of_tables(expr, expected):
    problem = follow(expr)
    assert problem.compile().phases[0].corners == pytest.approx(expected, abs=1e-9)
    for method in coarse_meshes(problem):
        mesh = method.mesh_of("run")
        assert np.abs(np.subtract.outer(np.array(mesh.edges), np.array(expected) / 5)).min(axis=0) == pytest.approx(0, abs=1e-9)
        assert np.diff(mesh.edges).max() <= 1 / method.elements + 1e-12 and mesh.elements <= method.elements + len(expected)


def test_free_times_have_no_corners():
    assert follow(lambda phase: table()(phase.time), tf=(4, 5)).compile().phases[0].corners == ()


def test_a_table_is_followed_exactly():
    point = optimize(follow(lambda phase: table()(phase.time)))
    assert point.verified and point.objectives["miss"] < 1e-10
