"""The builder: a multi-objective optimal control problem, stated with CasADi expressions."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from graphlib import CycleError
from types import MappingProxyType
from typing import Any

import casadi as ca

from . import checks
from .compiled import CompiledPhase, CompiledProblem, Limit, Link, Objective, Variable, in_time, vector_function
from .phase import Phase
from .sampling import check_links, samples, with_sizes

DEFAULT_EVALUATIONS = 2_000
"""Default number of evaluations of a case of the catalogue that does not set its own."""


class Problem:
    """A multi-objective optimal control problem: phases, parameters, objectives, constraints and links.

    Every mistake that can be seen at once raises a ValueError that names it; the rest is found by `compile`, before any work.

    Tables are made by `casadi.interpolant`. One of splines ("bspline") is 0 outside its grid, without a word, and a solver may try whatever
    the bounds of the states allow, or a little more between the nodes: its grid has to be wider than that, as in `standard/climb`.

    Attributes
    ----------
    default_transcription, default_evaluations, default_inner, default_start, default_verify
        What calls use by default (`default_verify`: only the command line); transcription None: DFET on a mesh that is found. A case may
        set its own; a transcription, too, as a table of its method and settings, where phases have meshes of their own. The number of
        evaluations is for studies and for searches that need one; MACS searches until it is done. None: the call must state it.

    Examples
    --------
    >>> from problems import Problem
    >>> problem = Problem("coast")
    >>> phase = problem.phase("glide", t0=0.0, tf=(1.0, 2.0))
    >>> x = phase.state("x", bounds=(0, 10), initial=0)
    >>> phase.dynamics(x=1.0)
    >>> problem.minimize("time", phase.tf, unit="s")
    >>> problem.maximize("distance", phase.final(x))
    """

    def __init__(self, name: str) -> None:
        checks.new_name("problem", name, (), "Problem")
        self.name = name
        self.address = ""
        self.data: Mapping[str, Any] = {}
        self.default_transcription: str | Mapping[str, Any] | None = None
        self.default_evaluations: int | None = None
        self.default_inner = "auto"
        self.default_start: str | None = None
        self.default_verify = 1e-3
        self._phases: dict[str, Phase] = {}
        self._parameters: dict[str, Variable] = {}
        self._symbols: dict[str, ca.MX] = {}
        self._objectives: dict[str, tuple[Objective, ca.MX]] = {}
        self._constraints: dict[str, tuple[Limit, ca.MX]] = {}
        self._links: dict[tuple[int, int], tuple[str, ...] | None] = {}
        self._guesses: dict[str, float] = {}

    def __repr__(self) -> str:
        return f"Problem('{self.name}', phases=[{', '.join(self._phases)}], objectives=[{', '.join(self._objectives)}])"

    @property
    def phases(self) -> Mapping[str, Phase]:
        """Phases by name."""
        return MappingProxyType(self._phases)

    @property
    def parameters(self) -> Mapping[str, ca.MX]:
        """Symbols of the parameters by name: a view, to which later parameters are added."""
        return MappingProxyType(self._symbols)

    @property
    def objectives(self) -> Mapping[str, ca.MX]:
        """Expressions of the objectives by name, as the user stated them."""
        return MappingProxyType({name: expr for name, (_, expr) in self._objectives.items()})

    def phase(self, name: str, *, t0: Any, tf: Any, duration: Any = None, time_unit: str = "s") -> Phase:
        """Add a phase.

        Parameters
        ----------
        t0, tf : float or pair
            Absolute times: a number is fixed, a pair is free within it.
        duration : float or pair, optional
            Limits of tf - t0, which is never negative.
        time_unit : str
            A label; the dynamics are rates per this unit. If it is one of lengths or angles, such as "m" or "rad", axes are called so.

        Returns
        -------
        Phase
        """
        checks.new_name("phase", name, self._phases, f"problem '{self.name}'")
        self._phases[name] = Phase(name, t0, tf, duration, time_unit, problem=self.name, parameters=self.parameters)
        self._phases[name]._owner = self
        return self._phases[name]

    def parameter(self, name: str, *, bounds: Any, unit: str = "", scale: float | None = None, integer: bool = False) -> ca.MX:
        """Add a static decision variable within finite bounds; returns its symbol, usable in any expression of any phase.

        `integer`: a whole number within the bounds, which belong to it, such as a number of engines or of revolutions. Gradient solves keep
        the values of their start; up to 20 combinations are all solved; with more, the optimum over real numbers is rounded, and then the
        neighbours of the best are solved until none is better. Expressions have to be defined between whole numbers, too.
        """
        what = checks.new_name("parameter", name, self._parameters, f"problem '{self.name}'")
        limits = checks.whole(bounds, what) if integer else checks.interval(bounds, f"the bounds of {what}")
        unit, scale = checks.unit(unit, what), checks.scale(scale, limits[1] - limits[0] or 1.0, what)
        self._parameters[name] = Variable(name, *limits, unit, scale, integer=integer)
        self._symbols[name] = ca.MX.sym(name)
        return self._symbols[name]

    def constraint(self, name: str, expr: Any, *, lower: Any = None, upper: Any = None, unit: str = "", scale: float | None = None) -> None:
        """Limit an expression of `initial`, `final`, `integral`, `peak`, times and parameters of any phases.

        `unit` and `scale` are as in `Phase.path`.
        """
        what = checks.new_name("constraint", name, self._constraints, f"problem '{self.name}'")
        self._constraints[name] = checks.limit(name, lower, upper, unit, scale, what), self._expression(expr, what)

    def link(self, first: Phase, second: Phase, *, states: Any = None) -> None:
        """Make phase `second` begin when and where phase `first` ends.

        Parameters
        ----------
        states : sequence of str, optional
            The states that are continuous; by default all that have the same name in both once the problem is stated. Time always is. For
            a jump, leave a state out and state it with `constraint`.
        """
        numbers = []
        for phase in (first, second):
            if not isinstance(phase, Phase) or self._phases.get(phase.name) is not phase:
                raise ValueError(f"problem '{self.name}': link takes two of its phases, not {phase!r}")
            numbers.append(list(self._phases).index(phase.name))
        place = f"the link from phase '{first.name}' to phase '{second.name}'"
        pair, common = (numbers[0], numbers[1]), _common(first, second)
        chosen = None if states is None else (states,) if isinstance(states, str) else tuple(states)
        for name in chosen or ():
            if name not in common:
                raise ValueError(f"{place}: '{name}' is not a state of both; they share {', '.join(common) or 'none'}")
        if pair in self._links:
            raise ValueError(f"{place} is given twice")
        try:
            in_time(len(self._phases), [Link(*joined, ()) for joined in (*self._links, pair)])
        except CycleError:
            raise ValueError(f"{place} would make time run in a circle; state a periodic condition with `constraint`") from None
        self._links[pair] = chosen

    def minimize(self, name: str, expr: Any, *, unit: str = "", scale: float | None = None) -> None:
        """Add an objective to be minimised: an expression of the same kind as a constraint's.

        Differences of this objective are divided by `scale` where points are compared or verified; by default it is found
        from the front.
        """
        self._objective(name, expr, unit, "minimize", scale)

    def maximize(self, name: str, expr: Any, *, unit: str = "", scale: float | None = None) -> None:
        """Add an objective to be maximised; otherwise as `minimize`."""
        self._objective(name, expr, unit, "maximize", scale)

    def with_objectives(self, *names: str) -> Problem:
        """The same problem with these objectives only; both share all else. Raises ValueError for one that it has not, naming its own."""
        other, unknown = copy(self), [name for name in names if name not in self._objectives]
        if unknown:
            raise ValueError(checks.unknown("objective", unknown[0], self._objectives))
        other.address, other.data, other._objectives = "", {}, {name: self._objectives[name] for name in names}
        used = ca.symvar(ca.vertcat(*(expr for _, expr in (*other._objectives.values(), *self._constraints.values()))))
        other._phases = {name: phase._with_used(used) for name, phase in self._phases.items()}
        return other

    def guess(self, **parameters: float) -> None:
        """Set initial guesses of parameters, by name."""
        for name, value in parameters.items():
            what = f"problem '{self.name}': the guess of parameter '{name}'"
            if name not in self._parameters:
                raise ValueError(f"{what}: there is no such parameter; there are {', '.join(self._parameters) or 'none'}")
            self._guesses[name] = checks.guessed(checks.number(value, what), self._parameters[name], what)
            if self._parameters[name].integer and value != round(value):
                raise ValueError(f"{what} must be a whole number, not {value:g}")

    def compile(self) -> CompiledProblem:
        """Check the whole and turn it into plain data and named CasADi Functions, which pickle.

        Raises
        ------
        ValueError
            No phase, no objective, a phase without states or dynamics, expressions that are NaN, ranges or links that leave nothing.
        """
        place = f"problem '{self.name}'"
        if not self._phases:
            raise ValueError(f"{place} has no phase")
        if not self._objectives:
            raise ValueError(f"{place} has no objective; add one with minimize or maximize")
        fixed = set().union(*(phase._constants() for phase in self._phases.values()))
        for name, (_, expr) in self._objectives.items():
            if all(symbol.__hash__() in fixed for symbol in ca.symvar(expr)):
                raise ValueError(f"objective '{name}' of {place} is a constant: no decision changes it")
        phases = list(self._phases.values())
        links = [Link(i, j, _common(phases[i], phases[j]) if states is None else states) for (i, j), states in self._links.items()]
        groups = {f"q{i}": phase._quantity_symbols() for i, phase in enumerate(phases)} | {"p": list(self._symbols.values())}
        compiled = CompiledProblem(
            name=self.name,
            phases=tuple(_narrowed([phase._compile() for phase in phases], links)),
            parameters=tuple(self._parameters.values()),
            guesses=dict(self._guesses),
            goals=tuple(goal for goal, _ in self._objectives.values()),
            limits=tuple(limit for limit, _ in self._constraints.values()),
            links=tuple(links),
            objectives=vector_function("objectives", groups, [goal.sign * expr for goal, expr in self._objectives.values()]),
            constraints=vector_function("constraints", groups, [expr for _, expr in self._constraints.values()]),
            address=self.address,
            data=dict(self.data),
        )
        labels = [phase._labels() for phase in phases]
        samples(compiled, labels)
        check_links(compiled, labels)
        return with_sizes(compiled)

    def _objective(self, name: str, expr: Any, unit: str, sense: str, scale: float | None) -> None:
        what = checks.new_name("objective", name, self._objectives, f"problem '{self.name}'")
        factor = None if scale is None else checks.scale(scale, 1.0, what)
        self._objectives[name] = Objective(name, checks.unit(unit, what), sense, factor), self._expression(expr, what)

    def _expression(self, value: Any, what: str) -> ca.MX:
        known = {symbol.__hash__() for symbol in self._symbols.values()}, *(phase._quantity_hashes for phase in self._phases.values())
        hint = (
            f"which is not of problem '{self.name}' or varies along a phase: "
            "use initial(...), final(...), integral(...) or peak(...) of a phase, times and parameters"
        )
        return checks.expression(value, known, what, hint)


def _common(first: Phase, second: Phase) -> tuple[str, ...]:
    """Names of the states of both phases."""
    return tuple(name for name in first._states if name in second._states)


def _narrowed(phases: list[CompiledPhase], links: list[Link]) -> list[CompiledPhase]:
    """The phases with the ranges of their times and boundary states narrowed by durations and links; an error if nothing is left.

    Along the links forward and back, until nothing changes: what narrows one phase is known to all that follow, or precede it, at once.
    """
    place = {i: k for k, i in enumerate(in_time(len(phases), links))}
    forward = sorted(links, key=lambda link: (place[link.first], place[link.second]))
    for _ in range(len(phases) + 1):
        before = list(phases)
        for link in (*forward, *reversed(forward)):
            for i, phase in zip((link.first, link.second), _joined(phases[link.first], phases[link.second], link.states), strict=True):
                phases[i] = _with_times_narrowed(phase)
        phases = [_with_times_narrowed(phase) for phase in phases]
        if all(new is old for new, old in zip(phases, before, strict=True)):
            break
    return phases


def _joined(first: CompiledPhase, second: CompiledPhase, states: tuple[str, ...]) -> tuple[CompiledPhase, CompiledPhase]:
    """Two phases with the ranges of what a link joins narrowed to what both allow; the same ones where they are so already."""
    what = f"the link from phase '{first.name}' to phase '{second.name}'"
    joint = checks.intersection((first.tf.lower, first.tf.upper), (second.t0.lower, second.t0.upper), f"{what}, time")
    final, initial = list(first.final), list(second.initial)
    places = [{state.name: i for i, state in enumerate(phase.states)} for phase in (first, second)]
    for name in states:
        i, j = places[0][name], places[1][name]
        final[i] = initial[j] = checks.intersection(final[i], initial[j], f"{what}, state '{name}'")
    return (
        _changed(first, tf=_ranged(first.tf, joint), final=tuple(final)),
        _changed(second, t0=_ranged(second.t0, joint), initial=tuple(initial)),
    )


def _with_times_narrowed(phase: CompiledPhase) -> CompiledPhase:
    what, (shortest, longest) = f"phase '{phase.name}', duration", phase.duration
    t0, tf = phase.t0, phase.tf
    end = checks.intersection((tf.lower, tf.upper), (t0.lower + shortest, t0.upper + longest), what)
    start = checks.intersection((t0.lower, t0.upper), (end[0] - longest, end[1] - shortest), what)
    if end[1] <= start[0]:
        raise ValueError(f"phase '{phase.name}' has no duration: t0 is at least {start[0]:g} and tf at most {end[1]:g}")
    return _changed(phase, t0=_ranged(t0, start), tf=_ranged(tf, end))


def _changed(phase: CompiledPhase, **values: Any) -> CompiledPhase:
    """A phase with these values; itself where it has them."""
    return phase if all(getattr(phase, name) == value for name, value in values.items()) else replace(phase, **values)


def _ranged(variable: Variable, limits: tuple[float, float]) -> Variable:
    return replace(variable, lower=limits[0], upper=limits[1], scale=limits[1] - limits[0] or 1.0)
