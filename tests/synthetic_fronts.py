"""Fronts built by hand: two phases with jumps in their controls, a black box, and their parts."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from macs.front import Front
from macs.fronts.point import Point
from macs.fronts.points import Points
from problems import Problem
from problems.compiled import CompiledProblem, Objective, Variable
from transcription.numerics.polynomials import nodes
from transcription.trajectories.costates import Costates, PhaseCostates
from transcription.trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory


def state_problem(name: str = "two legs", speed: float = 3.0) -> Problem:
    """Two linked phases, three objectives' worth of quantities of which two are stated; `speed` is the bound of v."""
    problem = Problem(name)
    mass = problem.parameter("mass", bounds=(1.0, 5.0), unit="kg")
    climb = problem.phase("climb", t0=0.0, tf=(5.0, 20.0))
    climb.state("h", bounds=(0.0, 40.0), initial=0.0, unit="km")
    v = climb.state("v", bounds=(-speed, speed), initial=0.0, unit="km/s")
    u = climb.control("u", bounds=(-1.0, 1.0), unit="km/s²")
    climb.dynamics(h=v, v=u / mass)
    climb.path("load", u * v, upper=2.0, unit="km²/s³")
    coast = problem.phase("coast", t0=(5.0, 20.0), tf=(6.0, 40.0))
    g = coast.state("h", bounds=(0.0, 40.0), unit="km")
    coast.dynamics(h=-0.1)
    problem.link(climb, coast, states=["h"])
    problem.minimize("time", coast.tf, unit="s")
    problem.maximize("height", coast.final(g), unit="km")
    return problem


@lru_cache(maxsize=1)
def compiled() -> CompiledProblem:
    return state_problem().compile()


def trajectory(rng: np.random.Generator, elements: int = 3, order: int = 4) -> Trajectory:
    problem = compiled()
    phases = []
    t0 = 0.0
    for phase in problem.phases:
        tf = t0 + rng.uniform(8.0, 15.0)
        edges = np.linspace(t0, tf, elements + 1)
        points = nodes("lobatto", order)
        middle = 0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * points
        rates = rng.normal(size=len(phase.states))
        states = 10 + 4 * np.sin(rates * middle[..., None] / 5 + 1)
        controls = rng.uniform(-0.8, 0.8, size=(elements, order, len(phase.controls)))
        state = PiecewisePolynomial(edges, states, "lobatto")
        control = PiecewisePolynomial(edges, controls, "legendre")
        time = np.unique(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))
        paths = np.tile(np.linspace(0, 2.0, len(time))[:, None], len(phase.paths))
        phases.append(
            PhaseTrajectory(
                phase.name,
                phase.time_unit,
                time,
                state(time),
                control(time),
                paths,
                state,
                control,
                phase.states,
                phase.controls,
                phase.paths,
            )
        )
        t0 = tf
    return Trajectory(tuple(phases), {"mass": float(rng.uniform(1, 5))})


def with_optional_phase(length: float) -> tuple[Trajectory, Costates]:
    """A trajectory whose coast is so long, with costates that are about 1 on the climb, and a thousand times as large on the coast."""
    climb, coast = trajectory(np.random.default_rng(0)).phases
    times = climb.tf + length * np.linspace(0.0, 1.0, len(coast.time))
    state = replace(coast.state, edges=climb.tf + length * np.linspace(0.0, 1.0, len(coast.state.edges)))
    flight = Trajectory((climb, replace(coast, time=times, state=state)), {"mass": 2.0})
    phases = {}
    for phase, size in zip(flight.phases, (1.0, 1000.0), strict=True):
        polynomial = PiecewisePolynomial(phase.state.edges, size * np.cos(phase.state.coefficients), "lobatto")
        names = tuple(one.name for one in phase.state_variables)
        phases[phase.name] = PhaseCostates(names, polynomial(phase.time), size * np.sin(phase.time), polynomial)
    return flight, Costates(np.array([0.5, 0.5]), phases)


def flights(n: int = 5, seed: int = 0, elements: int | list[int] = 3, **changes) -> Front:
    """A front of n trajectories; `elements` may differ from point to point."""
    rng = np.random.default_rng(seed)
    each = [elements] * n if isinstance(elements, int) else elements
    times = np.sort(rng.uniform(10, 30, n))
    columns = {
        "F": np.column_stack([times, -np.sqrt(times) - 3]),
        "decision": rng.normal(size=(n, 4)),
        "violation": rng.uniform(0, 1e-7, n),
        "status": ["converged"] * n,
        "violations": [{"climb.load": float(rng.uniform()), "link": 0.0} for _ in range(n)],
        "trajectories": [trajectory(rng, k) for k in each],
        "excursions": [{"u": 0.125 * i} if i else {} for i in range(n)],
        "variables": [Variable(f"climb.u[{i}]", -1.0, 1.0, "km/s²", 2.0) for i in range(4)],
        "goals": compiled().goals,
        "problem": compiled(),
        "transcriptions": {"method": "DFET", "settings": {"elements": 3, "order": 4, "basis": None}},
        "solver": {"name": "MACS", "settings": {"agents": 10, "archive": 10}},
        "stats": {"evaluations": 1000, "inner_iterations": 321, "failures": {"infeasible": 3}, "wall_time": 1.25, "seed": 7},
    }
    return Front(**{**columns, **changes})


def costated(length: float = 2.0) -> Front:
    """Two trajectories, of which the second has an optional phase so long, and costates."""
    trajectory, costates = with_optional_phase(length)
    front = flights(2, elements=[2, 3])
    return front.replace(trajectories=[front.trajectories[0], trajectory], costates=[None, costates])


def contents(of: Any) -> Any:
    """All that there is in a front, or in a part of one, but its compiled problem: equal for two if they have the same bits."""
    if isinstance(of, Front | Points):
        return {name: contents(value) for name, value in vars(of).items() if name != "_problem"}
    if isinstance(of, Point):
        return contents(of.alone())
    if isinstance(of, np.ndarray):
        return of.shape, of.dtype.kind, of.tolist() if of.dtype.kind in "UO" else np.ascontiguousarray(of).tobytes()
    if is_dataclass(of):
        return {field.name: contents(getattr(of, field.name)) for field in fields(of) if field.compare}
    if isinstance(of, Mapping):
        return {key: contents(value) for key, value in of.items()}
    return [contents(one) for one in of] if isinstance(of, tuple | list) else repr(of)


def black_box(n: int = 6, m: int = 2, seed: int = 0, **changes) -> Front:
    rng = np.random.default_rng(seed)
    directions = np.abs(rng.normal(size=(n, m)))
    columns = {
        "F": directions / np.linalg.norm(directions, axis=1, keepdims=True),
        "decision": rng.uniform(size=(n, 3)),
        "violation": np.zeros(n),
        "status": ["converged"] * n,
        "goals": [Objective(f"f{i}", "kg" if i == 0 else "", "minimize") for i in range(m)],
        "variables": [Variable(name, 0.0, 1.0, unit) for name, unit in (("span", "m"), ("chord", "m"), ("twist", ""))],
        "solver": {"name": "MACS", "settings": {}},
        "stats": {"evaluations": 200, "wall_time": 0.01},
    }
    return Front(**{**columns, **changes})


def marked(front: Front, verified: list[bool], seen: list[bool] | None = None) -> Front:
    """The front as if it had been simulated, all of it or the points `seen`, with objectives that are off by a hundredth."""
    saw = np.ones(len(front), dtype=bool) if seen is None else np.array(seen)
    return front.replace(
        defect=np.where(saw, 1e-5, np.nan),
        simulated_violation=np.where(saw, 1e-6, np.nan),
        simulated_F=np.where(saw[:, None], 1.01 * front.F, np.nan),
        tolerances=np.where(saw[:, None], 1e-3 + 0.02 * np.abs(front.F), np.nan),
        within=np.where(saw, 1e-3, np.nan),
        verified=np.array(verified),
        stats={**front.stats, "verify": 1e-3},
    )


def empty(**changes) -> Front:
    """A search that found nothing feasible."""
    least = flights(1, violation=[0.25], status=["infeasible"])
    return Front(
        **{
            "F": np.empty((0, 2)),
            "decision": [],
            "violation": [],
            "status": [],
            "goals": compiled().goals,
            "variables": least.variables,
            "problem": compiled(),
            "solver": least.solver,
            "message": "no feasible point: 'climb.load' is violated most",
            "closest": least[0],
            **changes,
        }
    )
