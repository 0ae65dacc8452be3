"""Multistart: the best of gradient solves of a scalarised problem from several starts.

A solve ends in the valley in which it begins. Most random controls give similar trajectories, so starts are of several kinds. Valleys near
the best known optimum are often better, so every second start lies near it: monotonic basin hopping; Leary, "Global optimization on
funneling landscapes", J. Global Optimization 18, 2000; for trajectories Englander and Conway, "Automated solution of the low-thrust
interplanetary trajectory problem", J. Guidance 40(1), 2017. The stopping rule: after k solves with w different optima, the probability that
the next solve finds a new one is w (w + 1) / (k (k - 1)), with a uniform prior on the number of optima and the sizes of their valleys:
Boender and Rinnooy Kan, "Bayesian stopping rules for multistart global optimization methods", Mathematical Programming 37, 1987. A new one
is the best of the w + 1 with probability 1 / (w + 1), if the size of a valley says nothing of its depth; large ones are rather deeper.
Where one start alone found the best, they are not: the probability is 1 / 2 then.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from transcription.base import INFEASIBLE, NLP
from transcription.meshes.errors import objective_variations
from transcription.nlp.derivatives import convex_objectives, objective_gradients
from transcription.nlp.scalarized import Solved
from transcription.smooth import Smooth
from transcription.stopping import Stopped, stopping

from ..evaluation.evaluator import CONVERGED
from ..io.interrupts import spending
from ..io.workers import TOGETHER
from ..pareto.archive import Archive
from .scalarised import END, WORK, GradientSolves, Scalarised, at_bounds


@dataclass(frozen=True)
class MultistartLimits:
    """Tolerances between results, and the rules by which starts are enough."""

    excess: float = 1e-8  # part of an objective's range by which its limit may be exceeded
    iterations: int = 200  # most of each further start
    held: int = 50  # most iterations of a solve for given times: one that takes more has no feasible point, or is not convex
    infeasible: tuple[int, int] = (8, 16)  # fewest and most starts without a feasible vector; between them, what took `WORK.little`
    everywhere: int = 3  # starts from everywhere before only each second one is: the others are near the best that is known
    hopeless: float = 100.0  # scales by which propagated states violate constraints so that the states of the guess are the better start
    better: float = 0.0025  # probability that another start would find a better optimum below which there are enough
    fewest: int = 8  # solves after which none has converged that are enough
    # Where optima are many: solves that are enough, if there are also `last` times as many as it took to find the best, and most of all.
    many: tuple[int, int] = (60, 200)
    last: int = 2  # also the multiple of the work for starts where the best of several optima was found once: that is no proof
    values: tuple[int, int] = (20, 2)  # most combinations of whole numbers of which each is solved, until so often nothing is feasible
    same: float = 1e-3  # losses that differ by less are of one optimum: as a part of the differences between all optima,
    rounding: float = 1e-5  # and of their size; see also `MultistartStopping.accuracy`


MULTISTART = MultistartLimits()

ALMOST_CONSTANT, SLOW = Smooth(spread=1.0, length=3.0), Smooth(spread=1.0, length=0.3)
KINDS: tuple[tuple[Smooth | None, bool], ...] = (
    (ALMOST_CONSTANT, True),
    (SLOW, True),
    (None, True),
    (ALMOST_CONSTANT, True),
    (SLOW, True),
    (Smooth(spread=0.3), False),
)
"""How controls are drawn, and whether states are propagated from them: far from the middle of their bounds and mostly on them, since
trajectories of others are much alike; None evenly, each value by itself; and smooth about the middle with the states of the guess, from
which a solve also finds what nothing that is propagated comes near to."""
SPREADS, LENGTHS, WINDOWS = (0.02, 1.0), (0.05, 2.0), (0.05, 1.0)
"""Least and largest spread, in spans of the bounds, and length, of deviations from the best that is known, see `Smooth`; and of the part of
a phase in which controls deviate: what else there is to a good solution stays as it is."""


class Starts:
    """Starts of gradient solves of one NLP; later, every second start is near the best known vector."""

    def __init__(self, nlp: NLP, rng: np.random.Generator, drawn: int = 0) -> None:
        self._nlp, self._rng, self.drawn = nlp, rng, drawn

    def draw(self, best: np.ndarray | None = None) -> np.ndarray:
        """The next start, a full vector, with the whole numbers of the best known vector (n,), `best`. Returns (1 or 2, n)."""
        nlp, rng, first = self._nlp, self._rng, MULTISTART.everywhere
        drawn, self.drawn = self.drawn, self.drawn + 1
        lower, span = nlp.lower[nlp.free], nlp.span[nlp.free]
        candidates = (lower + rng.random(len(lower)) * span)[None]
        if drawn >= first and (drawn - first) % 2 and best is not None:
            return self._propagated(self._moved(best, candidates))[:1]
        shape, propagate = KINDS[(drawn if drawn < first else first + (drawn - first) // 2) % len(KINDS)]
        guessed = nlp.first_guess(candidates if shape is None else shape.shaped(nlp, candidates))[0]
        if best is not None:
            guessed[nlp.integers] = best[nlp.integers]
        return self._propagated(guessed) if propagate else guessed[None]

    def _moved(self, best: np.ndarray, candidates: np.ndarray) -> np.ndarray:
        """The vector (n,) with a random deviation of its free variables, of controls in a part of each phase."""
        nlp = self._nlp
        spread, length, width = (float(np.exp(self._rng.uniform(*np.log(limits)))) for limits in (SPREADS, LENGTHS, WINDOWS))
        middle, about = self._rng.random(), best[nlp.free]
        deviation = Smooth(spread, length).shaped(nlp, candidates, about)[0] - about
        for profile in nlp.profiles:
            deviation[profile.columns] *= np.exp(-(((profile.places - middle) / width) ** 2))
        moved = best.copy()
        moved[nlp.free] += deviation
        moved[nlp.integers] = best[nlp.integers]
        return moved

    def _propagated(self, z: np.ndarray) -> np.ndarray:
        """The vector with propagated states, unless these violate constraints hopelessly, and the vector itself."""
        states = self._nlp.propagate(z[None])
        usable = np.isfinite(states).all() and self._nlp.evaluate(states)[1][0] <= MULTISTART.hopeless
        return np.vstack([states, z]) if usable else z[None]


class MultistartStopping:
    """Stopping rule of a multistart: the number of optima, how often the best was found, and whether the starts are enough."""

    def __init__(self, better: float = MULTISTART.better) -> None:
        self.results: list[float] = []  # losses in the order of the starts, NaN for one that ended at no optimum
        self.convex = False  # convex: for given times, and these were tried: no start finds another optimum
        self._last, self._better, self.accuracy = 0, better, 0.0  # accuracy of losses, whatever their size: near zero that says nothing

    def add(self, loss: float | None) -> bool:
        """Count a solve that ended at an optimum with this loss, or at none; returns whether it is the best so far."""
        known = self._losses
        self.results.append(np.nan if loss is None else loss)
        if loss is None or not np.isfinite(loss):
            return False
        better = not known or loss < min(known) - MULTISTART.rounding * abs(loss)
        self._last = self.starts if better else self._last
        return better

    @property
    def starts(self) -> int:
        """Solves that were counted."""
        return len(self.results)

    @property
    def _losses(self) -> list[float]:
        return [loss for loss in self.results if np.isfinite(loss)]

    @property
    def converged(self) -> int:
        """Solves that ended at an optimum."""
        return len(self._losses)

    def optima(self, same: float | None = None) -> int:
        """Optima that differ by more than `same`; by default, by more than a small part of the differences between all."""
        apart = np.diff(np.sort(self._losses)) > (self._same if same is None else same)
        return int(np.count_nonzero(apart)) + bool(self._losses)

    def hits(self, loss: float | None = None, same: float | None = None) -> int:
        """How often an optimum with this loss was found, by default the best."""
        if not self._losses:
            return 0
        differences = np.abs(np.array(self._losses) - (min(self._losses) if loss is None else loss))
        return int(np.count_nonzero(differences <= (self._same if same is None else same)))

    @property
    def found_once(self) -> bool:
        """Whether one start alone found the best of several optima."""
        return self.several and self.hits() == 1

    @property
    def several(self) -> bool:
        """Whether starts found several optima that other starts may improve."""
        return self.optima() > 1 and not self.convex

    @property
    def enough(self) -> bool:
        """Whether further starts are not expected to find another optimum, or have found nothing better for long."""
        return self.needed <= 0

    @property
    def needed(self) -> int:
        """How many starts more there will be at least; 0 or less where there are enough."""
        if not self.converged:
            return MULTISTART.fewest - self.starts
        if self.convex:
            return 0
        many, optima = int(np.clip(MULTISTART.last * self._last, *MULTISTART.many)), self.optima()
        # The least k with optima <= better k (k - 1). Where one start alone found the best, small valleys may be deep: a new one is better
        # with probability 1 / 2 then.
        weight = optima * ((optima + 1) / 2 if self.found_once else 1)
        pairs = weight / (self._better if optima == 1 else MULTISTART.better)
        return min(many - self.starts, int(np.ceil(0.5 + np.sqrt(0.25 + pairs))) - self.converged)

    @property
    def _same(self) -> float:
        losses = np.array(self._losses)
        if not len(losses):
            return 0.0
        return max(MULTISTART.same * float(np.ptp(losses)), MULTISTART.rounding * float(np.abs(losses).max()), self.accuracy)


Rules = Mapping[int, MultistartStopping]
"""What starts found for objectives."""


class MultistartSolver:
    """Solver of scalarised problems of one NLP, each from its best known vector and from `starts`, None for as many as pay; given (k,
    n)."""

    def __init__(
        self,
        nlp: NLP,
        given: np.ndarray | None,
        starts: int | None,
        rng: np.random.Generator,
        solves: GradientSolves,
        better: float = MULTISTART.better,
        most: float = np.inf,
    ) -> None:
        self.nlp, self.starts, self.solves, self.rng = nlp, starts, solves, rng
        self.stopping, self.most, self._better = dict[int, MultistartStopping](), most, better
        self.closest: Solved | None = None  # what violates least, where nothing is feasible
        self._missed = Counter[tuple[float, ...]]()  # how many solves with these whole numbers ended at nothing feasible
        self._timed, self._uneven = False, list[int]()  # whether optima for given times were sought, and whose do not fall with time
        self._starts = Starts(nlp, rng)
        Z = np.empty((0, len(nlp.variables))) if given is None else given
        self._given = len(Z)
        self._known = Archive(Z, *(nlp.evaluate(Z) if len(Z) else (np.empty((0, len(nlp.problem.goals))), np.empty(0))))

    @property
    def drawn_enough(self) -> bool:
        """Whether the largest number of starts has been drawn."""
        return self._starts.drawn >= self.most

    @property
    def convex(self) -> np.ndarray:
        """Which objectives (m,) have one optimum for each time, and do not get worse with time: no start finds a better one."""
        return convex_objectives(self.nlp) & ~np.isin(np.arange(len(self.nlp.problem.goals)), self._uneven)

    @spending("starts")
    def _over_times(self) -> None:
        """Once, where there is a free time: add to what is known the optima for given times, from the longest on, each from the one before,
        of the objectives that are convex then, and not of that time alone."""
        times, m = self.nlp.times, len(self.nlp.problem.goals)
        if self._timed or not len(times) or not self.convex.any():
            return
        self._timed, (rows, columns) = True, objective_gradients(self.nlp).sparsity_out(0).get_triplet()
        for i in np.intersect1d(np.array(rows)[~np.isin(columns, times)], np.flatnonzero(self.convex)).tolist():
            z, failed, least = self._known.Z[0] if len(self._known) else self._starts.draw()[0], 0, -np.inf
            for given in np.linspace(self.nlp.upper[times], self.nlp.lower[times], 17):
                (found,) = self._held(z, Scalarised.single(i, m), [given])
                failed = 0 if found.status == CONVERGED else failed + 1
                if failed == 2 or stopping():  # shorter times are infeasible, too
                    break
                if not failed:
                    self._uneven += [i] if found.F[i] < least - MULTISTART.rounding * abs(least) else []
                    z, least = self._added(found).z, found.F[i]

    def _held(self, start: np.ndarray, task: Scalarised, times: Sequence[np.ndarray]) -> list[Solved]:
        """The results of solves from a vector (n,) for given times (k,) each."""
        tasks = [replace(task, held=dict(zip(self.nlp.times.tolist(), given, strict=True))) for given in times]
        with self.solves.at_most(MULTISTART.held):
            return self.solves.each(self.nlp, [(start, one) for one in tasks])

    def _added(self, solved: Solved) -> Solved:
        """A result, which is known from now on if it converged."""
        if solved.status == CONVERGED:
            self._known = self._known.joined(Archive(solved.z[None], solved.F[None], np.array([solved.violation])))
        return solved

    def solve(self, task: Scalarised, start: np.ndarray | None = None) -> Solved:
        """The best result of `starts` solves, the first from `start` (n,) or the best known vector for this problem."""
        return self.solve_all([task], start)[0]

    def solve_all(self, tasks: Sequence[Scalarised], start: np.ndarray | None = None) -> list[Solved]:
        """The same for several problems, side by side."""
        self._over_times()
        firsts = [start if start is not None else self.nearest(task) for task in tasks]
        begun = [(first, task) for first, task in zip(firsts, tasks, strict=True) if first is not None]
        others = [task for first, task in zip(firsts, tasks, strict=True) for _ in range((self.starts or 1) - (first is not None))]
        found = [*zip((task for _, task in begun), self.from_vectors(begun), strict=True)]
        drawn = self.from_draws(others)
        found += [*zip(others, drawn, strict=True)]
        best = [min((solved for other, solved in found if other is task), key=task.rank) for task in tasks]
        good = [any(one is other for other in drawn) for one in best if one.status == CONVERGED]
        self.solves.counts.keep(good.count(False))
        with spending("starts"):
            self.solves.counts.keep(good.count(True))
        return self.over_values(best, tasks)

    def better(self, known: Solved, new: Solved, task: Scalarised) -> Solved:
        """The better of two results, the new one of which is then counted as kept."""
        best = min(known, new, key=task.rank)
        self.solves.counts.keep(best is new and new.status == CONVERGED)
        return best

    def over_values(self, found: Sequence[Solved], tasks: Sequence[Scalarised]) -> list[Solved]:
        """The better of each result and those with other whole numbers.

        Of few combinations each is solved. Of many, the optimum for real numbers, rounded, and then neighbours of the best, which differ in
        one number by one, until none is better.
        """
        return [self._over_values(one, task) for one, task in zip(found, tasks, strict=True)] if len(self.nlp.integers) else list(found)

    @spending("whole numbers")
    def _over_values(self, best: Solved, task: Scalarised) -> Solved:
        integers = self.nlp.integers
        lower, upper = self.nlp.lower[integers], self.nlp.upper[integers]
        few = np.prod(upper - lower + 1.0) <= MULTISTART.values[0]
        new: list[Any] = [*product(*map(np.arange, lower, upper + 1.0))] if few else []
        new = new or [tuple(self.solves(self.nlp.relaxed, best.z, task).z[integers].round())]
        tried, steps = {tuple(best.z[integers])}, np.vstack([np.eye(len(integers)), -np.eye(len(integers))])
        while (new := [one for one in new if one not in tried and self._missed[one] < MULTISTART.values[1]]) and not stopping():
            with self.solves.at_most(MULTISTART.iterations):
                solved = self.from_vectors([(self._with_value(best.z, np.array(value), task), task) for value in new])
            self._missed.update(value for value, one in zip(new, solved, strict=True) if one.violation > self.solves.tolerance)
            tried |= {*new}
            for one in solved:
                best = self.better(best, one, task)
            new = [] if few else [*dict.fromkeys(map(tuple, np.clip(best.z[integers] + steps, lower, upper)))]
        return best

    def _with_value(self, z: np.ndarray, value: np.ndarray, task: Scalarised) -> np.ndarray:
        """The best known feasible vector (n,) with these whole numbers, else this one with them."""
        same = (self._known.Z[:, self.nlp.integers] == value).all(axis=1)
        merits = np.where(same, self.merits(task, self._known.F, self._known.violation, strict=True), np.inf)
        return self._known.Z[np.argmin(merits)] if (merits < np.inf).any() else self._with(self.nlp.integers, z, value)

    def single(self, i: int) -> Solved:
        """The optimum of objective i alone. A solve from the best known vector may fail if that is an optimum of another objective within
        tight limits; then the given vectors are starts, too."""
        task = Scalarised.single(i, len(self.nlp.problem.goals))
        if self.closest is not None:
            return self.closest
        if self.starts is None and i not in self.stopping:
            self.stopping[i] = MultistartStopping(self._better)
            begun, solved = None, self.seek(task, self.stopping[i])
        else:
            begun = self.nearest(task)
            solved = self.solve(task)
        (solved,) = self.from_rivals([solved], [task])
        for start in self._known.Z[: self._given] if solved.status != CONVERGED and not self.closest else ():
            if begun is None or (start != begun).any():
                solved = self.better(solved, self.from_vector(start, task), task)
        return solved

    def seek(self, task: Scalarised, stopping_rule: MultistartStopping) -> Solved:
        """The best result of a multistart: further starts end when they have taken a little work, or as much as the first one."""
        before = self.solves.counts.work
        first = self.first(task)
        stopping_rule.add(task.optimum(first))
        return self.drawn(first, task, stopping_rule, max(WORK.little, self.solves.counts.work - before))[0]

    @spending("starts")
    def first(self, task: Scalarised, tries: tuple[int, int] | None = None) -> Solved:
        """The result of the first of several starts, from something feasible if it leads to nothing feasible; one that is drawn is given up
        soon: on a coarse mesh nothing may be feasible. See `with_feasible_start`."""
        self._over_times()
        if self.closest is not None or len(self._known):
            return self.with_feasible_start(self.closest or self.solve(task), task, tries)
        with self.solves.at_most(MULTISTART.iterations):
            solved = self.from_vector(self._starts.draw()[0], task)
        self.solves.counts.keep(solved.status == CONVERGED)
        (solved,) = self.over_values([solved], [task])
        if solved.status != CONVERGED and solved.violation <= self.solves.tolerance:
            return self.from_vector(solved.z, task)
        return self.with_feasible_start(solved, task, tries)

    @spending("starts")
    def drawn(self, best: Solved, task: Scalarised, stopping_rule: MultistartStopping, work: float) -> tuple[Solved, list[Solved]]:
        """The best result, one of which is known, and those of drawn starts, until there are enough or so much work is done; twice as much
        where the best of several optima was found only once."""
        found, before, sides = list[Solved](), self.solves.counts.work, self._sides()
        stopping_rule.convex = bool(self.convex[task.used].all())
        with suppress(Stopped):
            while not (stopping_rule.enough or self.closest or self.drawn_enough or stopping() or self.is_least(best, task)):
                left = work * (MULTISTART.last if stopping_rule.found_once else 1) - (self.solves.counts.work - before)
                if left <= 0.0:
                    break
                converged = stopping_rule.converged
                if converged and not stopping_rule.accuracy:
                    variations = objective_variations(self.nlp, best.z)[task.moving] / task.weights[task.moving]
                    stopping_rule.accuracy = END.clearly * float(variations.max())
                # Where none has converged yet, they may all take long.
                with self.solves.at_most(MULTISTART.iterations if converged else self.solves.max_iterations):
                    if sides:
                        new, sides = self.from_times(best.z, task, sides), []
                    else:
                        cost = float(np.mean([one.iterations for one in (best, *found)])) * len(self.nlp.variables)
                        paid, room = max(left / max(cost, 1.0), 1.0), self.most - self._starts.drawn
                        count = int(min(TOGETHER, stopping_rule.needed, room, paid))
                        new = self.from_draws([task] * count, [best] * count if converged else ())
                found += new
                # One that is hardly better is the same optimum: that of the first start is as good.
                for one in new:
                    better = stopping_rule.add(task.optimum(one))
                    self.solves.counts.keep(better)
                    if better or (not stopping_rule.converged and one.violation < best.violation):
                        best = one
        if stopping_rule.convex and (rival := self.rival(best, task)) is not None:
            best = self.better(best, self.from_vector(rival, task, near=True), task)
        return self.over_values([best], [task])[0] if found else best, found

    @spending("starts")
    def with_feasible_start(self, solved: Solved, task: Scalarised, tries: tuple[int, int] | None = None) -> Solved:
        """The result of a solve or, if infeasible, of one from a feasible vector near the best known or drawn ones, whose fewest and most
        numbers are `tries`; without any, what violates least, now and later: `closest`."""
        if self.closest is not None:
            return self.closest
        if solved.violation <= self.solves.tolerance or len(self._known) > self._given:
            return solved
        tried, limit, starts = list[Solved](), self.solves.counts.work + WORK.little, self._first_starts(solved.z, task)
        fewest, most = tries or MULTISTART.infeasible
        while not stopping() and len(tried) < most and (len(tried) < fewest or self.solves.counts.work < limit):
            near = self.solves.least_violation(self.nlp, next(starts))
            if near.status == CONVERGED:
                return self.better(solved, self.from_vector(near.z, task), task)
            tried.append(near)
        if sum(near.status == INFEASIBLE for near in tried) >= fewest:
            self.closest = min(tried, key=lambda near: near.violation)
        return self.closest or solved

    def _first_starts(self, z: np.ndarray, task: Scalarised) -> Iterator[np.ndarray]:
        """Vectors (n,) near which something feasible is sought: the best known, one (n,) with its times at their bounds, and drawn ones."""
        known = self.nearest(task)
        yield from () if known is None else (known,)
        yield from (self._with(self.nlp.times, z, times) for times in self._sides())
        while True:
            yield self._starts.draw()[0]

    def from_vector(self, start: np.ndarray, task: Scalarised, near: bool = False) -> Solved:
        """The result of one solve from a vector (n,), or near it only; if it converged, later solves may begin at it."""
        return self.from_vectors([(start, task)], near)[0]

    def from_vectors(self, begun: Sequence[tuple[np.ndarray, Scalarised]], near: bool = False) -> list[Solved]:
        """The same for several vectors, each with its problem, side by side."""
        return [self._added(solved) for solved in self.solves.each(self.nlp, begun, near)]

    @spending("starts")
    def from_draws(self, tasks: Sequence[Scalarised], known: Sequence[Solved] = ()) -> list[Solved]:
        """The result of a solve of each problem from a random start, near a known optimum where there is one; without, from the states of
        the guess if propagated ones lead to no optimum."""
        best = [one.z if one.status == CONVERGED else None for one in known] or [None] * len(tasks)
        drawn = [self._starts.draw(z) for z in best]
        found = self.from_vectors([(starts[0], task) for starts, task in zip(drawn, tasks, strict=True)])
        again = [k for k, one in enumerate(found) if one.status != CONVERGED and best[k] is None and len(drawn[k]) > 1]
        for k, other in zip(again, self.from_vectors([(drawn[k][1], tasks[k]) for k in again]), strict=True):
            found[k] = min(found[k], other, key=tasks[k].rank)
        return found

    def _sides(self) -> list[np.ndarray]:
        """Times (k,) to begin with: all at their upper bounds, then all at their lower ones."""
        times = self.nlp.times
        return [self.nlp.upper[times], self.nlp.lower[times]] if len(times) else []

    @staticmethod
    def _with(which: np.ndarray, z: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The vector (n,) with other values (k,) of some variables (k,)."""
        other = z.copy()
        other[which] = values
        return other

    def from_times(self, start: np.ndarray, task: Scalarised, times: Sequence[np.ndarray]) -> list[Solved]:
        """The results of solves that begin at the optima for given times (k,), from a vector (n,): a linear-quadratic problem is convex
        for given times, and where these are free, too, its solves end at times where the optimum hardly depends on them."""
        found = self._held(start, task, times)
        good = [k for k, one in enumerate(found) if one.status == CONVERGED]
        for k, solved in zip(good, self.from_vectors([(found[k].z, task) for k in good], near=True), strict=True):
            found[k] = solved
        return found

    def merits(self, task: Scalarised, F: np.ndarray, violation: np.ndarray, strict: bool = False) -> np.ndarray:
        """Merits (k,) of points F (k, m), to be minimised: alpha plus the excess over constraints, and over limits in ranges of the known
        points; if `strict`, as for results, any excess is infinite."""
        hard = task.hard
        ranges = np.ptp(self._known.F[:, hard], axis=0) if len(self._known) else np.ones(hard.sum())
        over = (np.maximum(F[:, hard] - task.reference[hard], 0.0) / np.where(ranges > 0, ranges, 1.0)).sum(axis=1)
        excess = over + np.where(violation <= self.solves.tolerance, 0.0, violation)
        merit = task.alpha(F) + (np.where(excess > MULTISTART.excess, np.inf, 0.0) if strict else excess)
        return np.where(np.isfinite(merit), merit, np.inf)

    def nearest(self, task: Scalarised) -> np.ndarray | None:
        """The known vector (n,) with the best merit, a feasible one where optima for given times are known; None if none is known."""
        merits = self.merits(task, self._known.F, self._known.violation, strict=len(self._known) > self._given and self._timed)
        return self._known.Z[np.argmin(merits)] if len(self._known) else None

    def rival(self, solved: Solved, task: Scalarised) -> np.ndarray | None:
        """A known vector (n,) that is clearly better for a problem than its own result; None if there is none."""
        if not len(self._known):
            return None
        merits = self.merits(task, self._known.F, self._known.violation, strict=True)
        own = self.merits(task, solved.F[None], np.array([solved.violation]))[0] if solved.status == CONVERGED else np.inf
        return self._known.Z[np.argmin(merits)] if merits.min() < own - END.clearly else None

    def from_rivals(self, found: Sequence[Solved], tasks: Sequence[Scalarised]) -> list[Solved]:
        """The better of each result and a solve from a better known vector; if that moves far away, also of one that stays near it."""
        found = list(found)
        for near in (False, True):
            rivals = {k: rival for k, task in enumerate(tasks) if (rival := self.rival(found[k], task)) is not None}
            again = self.from_vectors([(rival, tasks[k]) for k, rival in rivals.items()], near)
            for k, solved in zip(rivals, again, strict=True):
                found[k] = self.better(found[k], solved, tasks[k])
        return found

    def is_least(self, solved: Solved, task: Scalarised) -> bool:
        """Whether a result converged and is the least that bounds allow, see `is_least` beside this class."""
        return solved.status == CONVERGED and is_least(self.nlp, solved.z, task)


def is_least(nlp: NLP, z: np.ndarray, task: Scalarised) -> bool:
    """Whether a vector (n,) attains the least value of a linear objective, the only one of the problem, over the bounds of the variables:
    no other start can improve it then."""
    (used,) = np.nonzero(task.used)
    return len(used) == 1 and at_bounds(nlp, z, int(used[0])) is not None


def guessed_start(nlp: NLP) -> np.ndarray | None:
    """The problem's guess as a full vector (1, n), with the middle of the bounds where nothing is guessed; None without any guess."""
    if not np.isfinite(nlp.guess).any():
        return None
    middle = 0.5 * (nlp.lower[nlp.free] + nlp.upper[nlp.free])
    return nlp.first_guess(np.where(np.isfinite(nlp.guess), nlp.guess, middle)[None])
