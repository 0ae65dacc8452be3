"""Random optimal control problems: stated for MACS, and as plain terms from which other code flies them."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from random_terms import Term, random_term, symbolic, with_pulse

from problems import Problem
from problems.phase import Phase
from transcription import DFET, Collocation, MultipleShooting, SingleShooting

Limits = tuple[float, float]


@dataclass
class PlainPhase:
    """A phase as plain data: bounds and rates of its states by name, bounds of its controls, path constraints with their limits."""

    name: str
    states: dict[str, Limits] = field(default_factory=dict)
    controls: dict[str, Limits] = field(default_factory=dict)
    rates: dict[str, Term] = field(default_factory=dict)
    finals: dict[str, Limits] = field(default_factory=dict)
    paths: list[tuple[str, Term, float, float]] = field(default_factory=list)


@dataclass
class PlainProblem:
    """A problem as plain data; each objective is ("tf", phase) or (kind of quantity, phase, term), with its name and sense."""

    phases: list[PlainPhase] = field(default_factory=list)
    linked: bool = False
    objectives: list[tuple[str, str, str, PlainPhase, Term | None]] = field(default_factory=list)


def random_flight(seed: int) -> tuple[Problem, PlainProblem, Any]:
    """A problem, the same as plain data, and a transcription for it, or None."""
    rng = np.random.default_rng(seed)
    problem, plain = Problem(f"random {seed}"), PlainProblem()
    risk = float(rng.choice([0.0, 0.1, 0.4]))
    pulses = np.random.default_rng([seed, 2])
    parameters = {"p": problem.parameter("p", bounds=_limits(rng))} if rng.random() < 0.3 else {}
    t0 = float(rng.choice([0.0, 0.0, -1.0, 5.0]))
    times = [_end(rng, t0)]
    if rng.random() < 0.25:
        last = times[0] if isinstance(times[0], float) else times[0][1]
        times.append((last, last + float(rng.choice([0.5, 3.0]))))
    phases: list[Phase] = []
    for k, tf in enumerate(times):
        begins = t0 if k == 0 else times[0]
        phases.append(problem.phase(f"part {k}", t0=begins, tf=tf))
        plain.phases.append(_filled(rng, phases[-1], parameters, risk, first=k == 0, like=plain.phases[0] if k else None))
        if pulses.random() < 0.2:
            _narrow_path(pulses, phases[-1], plain.phases[-1])
    if len(phases) == 2 and rng.random() < 0.8:
        problem.link(*phases)
        plain.linked = True
    for k in range(int(rng.choice([1, 2, 2, 2, 3]))):
        _objective(rng, problem, plain, phases, parameters, risk, f"objective {k}")
    if pulses.random() < 0.2:
        _narrow_peak(pulses, problem, plain, phases)
    return problem, plain, _transcription(rng)


def _filled(
    rng: np.random.Generator, phase: Phase, parameters: dict[str, ca.MX], risk: float, first: bool, like: PlainPhase | None
) -> PlainPhase:
    """States, controls, rates and limits of a phase."""
    plain, symbols = PlainPhase(phase.name), dict(parameters)
    names = list(like.states) if like else [f"x{i}" for i in range(int(rng.integers(1, 4)))]
    for name in names:
        limits = like.states[name] if like and rng.random() < 0.8 else _limits(rng)
        initial = _inside(rng, limits) if first and rng.random() < 0.8 else None
        final = _inside(rng, limits) if rng.random() < 0.25 else None
        symbols[name] = phase.state(name, bounds=limits, initial=initial, final=final)
        plain.states[name] = limits
        if final is not None:
            plain.finals[name] = final if isinstance(final, tuple) else (final, final)
    for name in [f"u{i}" for i in range(int(rng.choice([0, 1, 1, 1, 2])))]:
        limits = _limits(rng, small=True)
        symbols[name] = phase.control(name, bounds=limits)
        plain.controls[name] = limits
    symbols["t"] = phase.time
    for i, name in enumerate(names):
        chained = i + 1 < len(names) and rng.random() < 0.5
        term = ("name", names[i + 1]) if chained else random_term(rng, list(symbols), int(rng.integers(1, 4)), risk)
        if plain.controls and not chained and rng.random() < 0.8:
            term = ("+", term, ("name", "u0"))
        plain.rates[name] = term
    phase.dynamics(**{name: symbolic(term, symbols) for name, term in plain.rates.items()})
    if rng.random() < 0.3:
        term = random_term(rng, list(symbols), 2, risk)
        lower, upper = _sides(rng)
        phase.path("path", symbolic(term, symbols), lower=lower, upper=upper)
        plain.paths.append(("path", term, -np.inf if lower is None else lower, np.inf if upper is None else upper))
    return plain


def _objective(
    rng: np.random.Generator,
    problem: Problem,
    plain: PlainProblem,
    phases: list[Phase],
    parameters: dict[str, ca.MX],
    risk: float,
    name: str,
) -> None:
    k = int(rng.integers(len(phases)))
    phase, its = phases[k], plain.phases[k]
    kind = str(rng.choice(["tf", "final", "final", "integral", "integral", "peak"]))
    sense = "minimize" if kind == "peak" or rng.random() < 0.7 else "maximize"
    term: Term | None = None
    if kind == "tf":
        expression: Any = phase.tf
    else:
        known = [*its.states, *(its.controls if kind == "integral" else []), *parameters]
        term = random_term(rng, known, 2, risk)
        symbols = {word: phase[word] if word not in parameters else parameters[word] for word in known}
        expression = getattr(phase, kind)(symbolic(term, symbols))
    getattr(problem, sense)(name, expression)
    plain.objectives.append((name, sense, kind, its, term))


def _narrow_path(rng: np.random.Generator, phase: Phase, plain: PlainPhase) -> None:
    """A path constraint on a state and a pulse."""
    name = str(rng.choice(list(plain.states)))
    term, (lower, upper) = _pulsed(rng, name, plain), plain.states[name]
    limit = lower + float(rng.uniform(0.6, 1.1)) * (upper - lower)
    phase.path("narrow", symbolic(term, {one: phase[one] for one in plain.states} | {"t": phase.time}), upper=limit)
    plain.paths.append(("narrow", term, -np.inf, limit))


def _narrow_peak(rng: np.random.Generator, problem: Problem, plain: PlainProblem, phases: list[Phase]) -> None:
    """An objective that is the peak of a state and a pulse."""
    k = int(rng.integers(len(phases)))
    phase, its = phases[k], plain.phases[k]
    term = _pulsed(rng, str(rng.choice(list(its.states))), its)
    problem.minimize("narrow peak", phase.peak(symbolic(term, {one: phase[one] for one in its.states} | {"t": phase.time})))
    plain.objectives.append(("narrow peak", "minimize", "peak", its, term))


def _pulsed(rng: np.random.Generator, name: str, plain: PlainPhase) -> Term:
    """A state and a pulse in time or in a state."""
    where = str(rng.choice(["t", *plain.states]))
    return with_pulse(rng, ("name", name), where, plain.states.get(where, (0.0, 5.0)))


def _limits(rng: np.random.Generator, small: bool = False) -> Limits:
    """Bounds of many sizes; now and then far from zero, or only just apart."""
    size = float(10.0 ** rng.integers(-1, 2 if small else 4))
    middle = float(rng.choice([0.0, 0.0, 0.0, size, -0.5 * size, 1e4 * size if rng.random() < 0.1 else 0.0]))
    if rng.random() < 0.03:
        return middle, float(np.nextafter(middle, np.inf))
    return middle - size, middle + size


def _inside(rng: np.random.Generator, limits: Limits) -> Any:
    """A value within limits, or a range."""
    values = sorted(float(v) for v in rng.uniform(*limits, size=2).clip(*limits))
    value = float(rng.choice([0.5 * (limits[0] + limits[1]), values[0], limits[0]]))
    return (values[0], values[1]) if rng.random() < 0.2 else min(max(value, limits[0]), limits[1])


def _end(rng: np.random.Generator, t0: float) -> Any:
    """When a phase may end, now and then at its beginning."""
    length = float(rng.choice([0.1, 1.0, 1.0, 5.0, 100.0]))
    if rng.random() < 0.5:
        return t0 + length
    return (t0 + (0.0 if rng.random() < 0.15 else 0.2 * length), t0 + length)


def _sides(rng: np.random.Generator) -> tuple[float | None, float | None]:
    value = round(float(rng.normal()), 2)
    sides = [(None, value + 2.0), (value - 2.0, None), (value - 3.0, value + 3.0), (value, value)]
    return sides[int(rng.choice(4, p=[0.4, 0.3, 0.25, 0.05]))]


def _transcription(rng: np.random.Generator) -> Any:
    """One of every kind; None is a mesh that is found."""
    n, order = int(rng.integers(1, 6)), int(rng.integers(1, 5))
    points = str(rng.choice(["radau", "gauss", "lobatto", "chebyshev"]))
    return [
        DFET(n, order),
        DFET(n, order, basis="bernstein"),
        Collocation(n, order + 1, points=points),
        SingleShooting(4 * n),
        MultipleShooting(n, steps=order),
        SingleShooting(8 * n, control="linear"),
        None,
    ][int(rng.choice(7, p=[0.25, 0.2, 0.2, 0.12, 0.08, 0.1, 0.05]))]
