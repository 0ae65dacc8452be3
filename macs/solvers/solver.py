"""Solvers: what a user calls to search an optimal control problem or a plain function for its Pareto front."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from os import PathLike
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem, Objective, Variable
from problems.problem import Problem
from transcription.base import Transcription, check_freedom, check_problem
from transcription.inner import InnerSolver, inner_solver
from transcription.smooth import Smooth

from ..evaluation.bilevel import Bilevel
from ..evaluation.blackbox import BlackBox
from ..front import Front
from ..fronts.builders import black_box_points, trajectory_points
from .method import SearchMethod
from .progress import Progress
from .run import ENDED, SearchRun
from .start import beginning, check_run, decisions, drawing

Callback = Callable[[Progress], Any]
NO_TIME = 1e-6
"""Seconds that are left when there are none: what comes then ends before its first solve."""


class Solver(SearchMethod):
    """A search method with the two calls of its user: `solve` for optimal control problems, `minimize` for plain functions."""

    def solve(
        self,
        problem: Problem | CompiledProblem,
        transcription: Transcription,
        *,
        evaluations: int,
        seed: int | None = None,
        inner: str | InnerSolver = "auto",
        tolerance: float = 1e-6,
        start: Any = None,
        time_limit: float | None = None,
        progress: bool = False,
        callback: Callback | None = None,
        checkpoint: str | PathLike[str] | None = None,
    ) -> Front:
        """Search an optimal control problem for its Pareto front.

        Parameters
        ----------
        problem : Problem
        transcription : Transcription
        evaluations : int
            How many candidates may be sent to the inner level; never exceeded.
        seed : int, optional
            The same one gives the same bits. None draws one, which `stats` record.
        inner : str or InnerSolver
            "auto", "propagate", "ipopt", "ipopt-feasibility", or one of your own.
        tolerance : float
            Largest scaled residual of a feasible point.
        start : Front, Points, array (k, n), "uniform", "smooth" or Smooth, optional
            Decisions to begin with: all variables, or the free ones only; after the problem's guess, if there is one. Or how candidates are
            drawn: "uniform", each variable by itself, as all those that are missing otherwise, but without the guess; "smooth", random
            profiles about the guess, see `transcription.Smooth`.
        time_limit : float, optional
            Seconds after which the search, and what may come after it, ends with what it has; looked at, like Ctrl-C, before each batch and
            each solve by IPOPT. A safety net: a run that it ends is recorded as not reproducible.
        progress : bool
            Show how the search stands on the terminal.
        callback : callable, optional
            Called with a `Progress` after every iteration; the search ends if it returns True.
        checkpoint : path, optional
            A file that the run is kept in, now and then and whenever it ends. The same call goes on where it was, whether the run was
            killed, interrupted, out of time or stopped by the callback, and ends with the same bits as if it never had been. What was done
            since the last write is done again; writes are between iterations, and between the gradient solves that end a search, a second
            or more apart. So is a first population that was not finished. `time_limit` counts from each call, `stats["wall_time"]` sums
            them up. Of a run that has ended by itself, the same call returns the front again, without a search; an adaptive mesh is refined
            again. All that decides a run has to be the same: problem, transcription, settings, inner level, tolerance, start, budget and
            seed; a seed of None takes over that of the file. Should the file not be writable any more in the middle of the run, the search
            goes on, logs a warning, and `stats["checkpoint"]` says why.

        Returns
        -------
        Front
            Feasible, mutually non-dominated points. Empty if none was found: then `message` says why, and `closest` is the nearest.

        Raises
        ------
        ValueError
            If the problem is stated wrongly, an argument makes no sense, or the checkpoint is damaged or of another run, before any work.
        OSError
            If the checkpoint could not be written, before any work.
        """
        check_run(evaluations, seed, tolerance, time_limit, callback, checkpoint)
        check_problem(problem, transcription)
        solver = inner_solver(inner)
        nlp = transcription.nlp(problem)
        self.check_transcription(transcription, nlp.problem)
        check_freedom(nlp)
        self.check_objectives(len(nlp.problem.goals))
        about = self.about()
        level = {"inner": inner if isinstance(inner, str) else repr(inner)}
        drawn = drawing(start)
        evaluator = Bilevel(nlp, solver, float(tolerance), drawn if isinstance(drawn, Smooth) else None)
        certified = self.certifies and evaluator.has_gradients
        run = SearchRun(
            self,
            evaluator,
            goals=lambda: nlp.problem.goals,
            make_front=lambda state, stats: Front.of(
                trajectory_points(nlp, state.archive, state.closest, about, stats | level, certified=certified)
            ),
            budget=evaluations,
            seed=seed,
            start=beginning(start if drawn is None else None, nlp, guess=drawn.guess if isinstance(drawn, Smooth) else drawn is None),
            what={
                "solver": about,
                "problem": {"name": nlp.problem.name, "fingerprint": nlp.problem.fingerprint},
                "transcription": transcription.to_dict(),
                "first candidates": asdict(drawn) if isinstance(drawn, Smooth) else drawn,
                **level,
            },
        )
        began = time.perf_counter()
        front = run.go(time_limit, progress, callback, checkpoint)
        if front.stats["stopped"] not in ENDED:
            return front
        left = None if time_limit is None else max(time_limit - (time.perf_counter() - began), NO_TIME)
        return self.finish(front, left, progress)

    def minimize(
        self,
        function: Any,
        bounds: Any = None,
        *,
        evaluations: int,
        seed: int | None = None,
        constraints: Callable[[np.ndarray], np.ndarray] | None = None,
        names: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        senses: Sequence[str] | None = None,
        tolerance: float = 1e-6,
        start: Any = None,
        time_limit: float | None = None,
        progress: bool = False,
        callback: Callback | None = None,
        checkpoint: str | PathLike[str] | None = None,
    ) -> Front:
        """Search a plain vector function, or a pymoo Problem, for its Pareto front.

        Parameters
        ----------
        function : callable or pymoo Problem
            `function(X: (n, d)) -> F: (n, m)`, or `(F, G)` with G <= 0 where feasible. A row with NaN is a failed evaluation.
        bounds : pairs, pair of arrays, or mapping
            d pairs; (lower, upper) of length d > 2; or {name: pair}. Not needed for a pymoo Problem.
        evaluations : int
            How many rows of X may be evaluated; never exceeded.
        constraints : callable, optional
            `constraints(X) -> G`, G <= 0 where feasible.
        names, units, senses : sequences of str, optional
            Of the objectives; senses are "minimize" or "maximize".
        seed, tolerance, start, time_limit, progress, callback, checkpoint
            As for `solve`. Of the function, a checkpoint only knows its bounds and names: that it is the same one is the caller's to say.

        Returns
        -------
        Front

        Raises
        ------
        ValueError
            If an argument, or what the function returns, makes no sense, or the checkpoint is damaged or of another run.
        OSError
            If the checkpoint could not be written, before any work.
        """
        check_run(evaluations, seed, tolerance, time_limit, callback, checkpoint)
        box = BlackBox(function, bounds, constraints=constraints, names=names, units=units, senses=senses, tolerance=float(tolerance))
        if box.m_known is not None:
            self.check_objectives(box.m_known)
        sides = zip(box.variables, box.lower.tolist(), box.upper.tolist(), strict=True)
        variables = tuple(Variable(name, low, high, "", high - low) for name, low, high in sides)

        about = self.about()

        def goals() -> tuple[Objective, ...]:
            return tuple(Objective(*words) for words in zip(box.names, box.units, box.senses, strict=True))

        run = SearchRun(
            self,
            box,
            goals=goals,
            make_front=lambda state, stats: Front.of(black_box_points(state.archive, state.closest, goals(), variables, about, stats)),
            budget=evaluations,
            seed=seed,
            start=None if start is None else decisions(start, variables),
            what={
                "solver": about,
                "bounds": {v.name: (v.lower, v.upper) for v in variables},
                "objectives": {"number": box.m_known, "names": names, "units": units, "senses": senses},
                "constraints": constraints is not None,
            },
        )
        return run.go(time_limit, progress, callback, checkpoint)
