from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from transcription.shooting.runge_kutta import TABLEAUX

Tree = tuple  # of its branches
STAGES = {"euler": 1, "midpoint": 2, "heun": 2, "kutta3": 3, "rk4": 4, "rk38": 4, "rk8": 11}
ORDERS = {"euler": 1, "midpoint": 2, "heun": 2, "kutta3": 3, "rk4": 4, "rk38": 4, "rk8": 8}


@cache
def trees(order: int) -> list[Tree]:
    """All rooted trees with so many nodes."""

    def forests(total: int, largest: int):
        if not total:
            yield ()
        for size in range(min(total, largest), 0, -1):
            for tree in trees(size):
                for others in forests(total - size, size):
                    yield tuple(sorted((tree, *others)))

    return sorted(set(forests(order - 1, order - 1)))


def size(tree: Tree) -> int:
    return 1 + sum(map(size, tree))


def density(tree: Tree) -> int:
    return size(tree) * int(np.prod([density(branch) for branch in tree]))


def weights(A: np.ndarray, tree: Tree) -> np.ndarray:
    """Elementary weights of the stages (Hairer, Norsett and Wanner, II.2)."""
    return np.prod([A @ weights(A, branch) for branch in tree], axis=0) * np.ones(len(A))


def misses(name: str, order: int) -> float:
    """By how much the conditions of this order are missed."""
    method = TABLEAUX[name]
    return max(abs(np.array(method.b) @ weights(method.matrix, tree) - 1 / density(tree)) for tree in trees(order))


def test_there_are_as_many_trees_as_there_should_be():
    assert [len(trees(n)) for n in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]


@pytest.mark.parametrize("name", TABLEAUX)
def test_all_conditions_of_the_order_hold_and_those_of_the_next_do_not(name):
    order = TABLEAUX[name].order
    assert order == ORDERS[name] and len(TABLEAUX[name].b) == STAGES[name]
    assert max(misses(name, n) for n in range(1, order + 1)) < 1e-15
    assert misses(name, order + 1) > 1e-6


def propagated(name: str, n: int) -> np.ndarray:
    """The error after n steps from 0 to 2 of an equation whose solution is (exp(sin t), cos t)."""

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[0] * y[1], -np.sin(t) + 0.5 * (y[0] - np.exp(np.sin(t)))])

    y, h = np.array([1.0, 1.0]), 2.0 / n
    for k in range(n):
        y, _ = TABLEAUX[name].step(lambda c, at, k=k: rates((k + c) * h, at), y, h)
    return y - np.array([np.exp(np.sin(2.0)), np.cos(2.0)])


@pytest.mark.parametrize("name", TABLEAUX)
def test_errors_fall_with_the_order_on_an_equation_with_a_closed_form(name):
    n = 6 if name == "rk8" else 40
    coarse, fine = (np.linalg.norm(propagated(name, steps)) for steps in (n, 2 * n))
    assert np.log2(coarse / fine) == pytest.approx(TABLEAUX[name].order, abs=0.35)


@pytest.mark.parametrize("name", TABLEAUX)
def test_the_stability_function_is_what_a_step_does_to_an_exponential(name):
    method, z = TABLEAUX[name], np.array([-0.7, -3.0, 0.5 + 1.2j, 2j])
    stepped = [method.step(lambda c, y, each=each: each * y, 1.0, 1.0)[0] for each in z]
    assert np.allclose(method.stability(z), stepped, rtol=1e-13)
    # It agrees with the exponential up to its order, and is a polynomial of as many terms as there are stages.
    assert np.allclose(method.growth[: method.order + 1], [1 / np.prod(np.arange(1.0, k + 1)) for k in range(method.order + 1)], atol=1e-15)
    assert method.growth.shape == (len(method.b) + 1,)


@pytest.mark.parametrize(("name", "limit"), [("euler", 2.0), ("heun", 2.0), ("kutta3", 2.5127), ("rk4", 2.7853), ("rk38", 2.7853)])
def test_how_far_a_step_may_go_on_the_real_axis(name, limit):
    assert abs(TABLEAUX[name].stability(-limit + 1e-3)) < 1 < abs(TABLEAUX[name].stability(-limit - 1e-3))
