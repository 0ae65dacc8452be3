"""One phase of a problem, as its user states it."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any

import casadi as ca
import numpy as np

from . import checks
from .absolute import absolute_terms, branches, radicand
from .compiled import CompiledPhase, Limit, Variable, vector_function
from .externals import named, output_names
from .switching import COMPARISONS, at_time, corners, same, sides, switching, value_at

_KINDS = ("initial", "final", "integral", "peak")


class Phase:
    """A stretch of time with its own states, controls and dynamics. Made by `Problem.phase`.

    Parameters
    ----------
    name, t0, tf, duration, time_unit
        See `Problem.phase`.
    problem : str
        Name of the problem, for messages.
    parameters : mapping
        Symbols of the problem's parameters by name: a live view, since parameters may be declared after the phase.

    Attributes
    ----------
    name : str
    time, t0, tf : MX
        Time, and the times at which the phase begins and ends: always symbols, usable in any expression of the phase.

    Examples
    --------
    >>> from problems import Problem
    >>> glide = Problem("coast").phase("glide", t0=0.0, tf=(1.0, 2.0))
    >>> x = glide.state("x", bounds=(0, 10), initial=0, unit="m")
    >>> glide.dynamics(x=1.0)
    >>> glide
    Phase('glide', states=[x], controls=[])
    """

    def __init__(
        self, name: str, t0: Any, tf: Any, duration: Any, time_unit: str, *, problem: str, parameters: Mapping[str, ca.MX]
    ) -> None:
        self.name = name
        self._problem, self._parameters = problem, parameters
        self._owner: Any = None  # the Problem that made it
        checks.check_text(time_unit, f"phase '{name}': time_unit")
        self._time_unit = time_unit
        self._t0_range = checks.fixed_or_interval(t0, f"phase '{name}': t0")
        self._tf_range = checks.fixed_or_interval(tf, f"phase '{name}': tf")
        length = (0.0, float("inf")) if duration is None else checks.fixed_or_interval(duration, f"phase '{name}': duration")
        if length[1] <= 0 or length[0] < 0:
            raise ValueError(f"phase '{name}': the duration must be positive, not ({length[0]:g}, {length[1]:g})")
        self._duration = length
        self.time, self.t0, self.tf = (ca.MX.sym(f"{word} of {name}") for word in ("time", "t0", "tf"))
        self._symbols: dict[str, ca.MX] = {}
        self._hashes = {symbol.__hash__() for symbol in (self.time, self.t0, self.tf)}
        self._quantity_hashes = {symbol.__hash__() for symbol in (self.t0, self.tf)}
        self._states: dict[str, Variable] = {}
        self._controls: dict[str, Variable] = {}
        self._initial: dict[str, tuple[float, float]] = {}
        self._final: dict[str, tuple[float, float]] = {}
        self._rates: dict[str, ca.MX] = {}
        self._paths: dict[str, tuple[Limit, ca.MX]] = {}
        self._quantities: dict[str, list[tuple[ca.MX, ca.MX]]] = {kind: [] for kind in _KINDS}
        self._guesses: dict[str, Any] = {}

    def __repr__(self) -> str:
        return f"Phase('{self.name}', states=[{', '.join(self._states)}], controls=[{', '.join(self._controls)}])"

    def __getitem__(self, name: str) -> ca.MX:
        """The symbol of a state or control."""
        if name not in self._symbols:
            raise KeyError(f"phase '{self.name}' has no '{name}'; it has {', '.join(self._symbols) or 'nothing yet'}")
        return self._symbols[name]

    def state(self, name: str, *, bounds: Any, initial: Any = None, final: Any = None, unit: str = "", scale: float | None = None) -> ca.MX:
        """Declare a state.

        Parameters
        ----------
        bounds : pair
            Finite limits, all along the phase.
        initial, final : None, float or pair
            Free within the bounds, fixed, or free within a range, at t0 and at tf.
        unit : str
            A label, carried to tables, plots and files.
        scale : float, optional
            Residuals of the state are divided by it; by default the span of the bounds.

        Returns
        -------
        MX
            Its symbol.
        """
        what = self._new_name("state", name)
        limits = checks.interval(bounds, f"the bounds of {what}")
        if limits[0] == limits[1]:
            raise ValueError(f"the bounds of {what} are one value only, {limits[0]:g}; a constant is no state")
        ends = []
        for word, value in (("initial", initial), ("final", final)):
            end = limits if value is None else checks.fixed_or_interval(value, f"the {word} value of {what}")
            ends.append(checks.within(end, limits, f"the {word} value of {what}"))
        self._states[name] = Variable(name, *limits, checks.unit(unit, what), checks.scale(scale, limits[1] - limits[0], what))
        self._initial[name], self._final[name] = ends
        return self._new_symbol(name)

    def control(self, name: str, *, bounds: Any, unit: str = "", period: float | None = None, scale: float | None = None) -> ca.MX:
        """Declare a control within finite `bounds` (lower, upper); `unit` and `scale` are as in `state`.

        Parameters
        ----------
        period : float, optional
            For an angle that wraps around, its period in the control's unit; the bounds must be exactly one period wide.

        Returns
        -------
        MX
            Its symbol.
        """
        what = self._new_name("control", name)
        limits = checks.interval(bounds, f"the bounds of {what}")
        length = checks.period(period, limits, what)
        factor = checks.scale(scale, limits[1] - limits[0] or 1.0, what)
        self._controls[name] = Variable(name, *limits, checks.unit(unit, what), factor, length)
        return self._new_symbol(name)

    def dynamics(self, external: ca.MX | None = None, /, **rates: Any) -> None:
        """Give the rate of every state, per `time_unit`: an expression of the phase's symbols and the parameters, or a number.

        `external` has the rates of those states that `problems.external` names as what it returns.
        """
        place = f"phase '{self.name}'"
        if external is not None:
            names = output_names(external)
            if not set(names) <= set(self._states) or set(names) & set(rates):
                raise ValueError(f"{place}: the external returns [{', '.join(names)}], states are [{', '.join(self._states)}]")
            rates |= zip(names, ca.vertsplit(external), strict=True)
        if self._rates:
            raise ValueError(f"{place}: dynamics are given twice")
        self._check_rates(rates)
        self._rates = {name: self._expression(rates[name], f"{place}: the rate of '{name}'") for name in self._states}

    def path(self, name: str, expr: Any, *, lower: Any = None, upper: Any = None, unit: str = "", scale: float | None = None) -> None:
        """Limit an expression all along the phase; an equality where both limits are the same.

        Parameters
        ----------
        lower, upper : float, optional
            At least one.
        unit : str
            Of the expression and its limits, for tables, pictures and files.
        scale : float, optional
            Residuals are divided by it. By default the distance of two limits; of one limit, or an equality, 1 or a thousandth of its size,
            whichever is larger.
        """
        what = self._new_name("path", name)
        self._paths[name] = checks.limit(name, lower, upper, unit, scale, what), self._expression(expr, what)

    def initial(self, expr: Any) -> ca.MX:
        """The value of an expression of the phase's symbols at t0, for use in objectives and constraints."""
        return self._quantity("initial", expr)

    def final(self, expr: Any) -> ca.MX:
        """The value of an expression of the phase's symbols at tf, for use in objectives and constraints."""
        return self._quantity("final", expr)

    def integral(self, expr: Any) -> ca.MX:
        """The integral of an expression of the phase's symbols from t0 to tf, for use in objectives and constraints.

        `casadi.fabs(...)` in it, alone or as a term of a sum, times a number or not, is no obstacle to gradients where it is minimised or
        bounded above: a transcription may write it with bounds on both signs, which are smooth. So it is with a norm of controls,
        `casadi.norm_2(...)` or a root, `casadi.sqrt(u**2 + v**2 + 1e-8)`, which has a kink, or nearly, where all of them vanish. Other
        expressions with a kink stay as they are (`casadi.fmax(u, -u)`, `casadi.fabs(u) * x`): write `casadi.fabs(u)`, and
        `casadi.fabs(u * x)` where x is never negative.
        """
        terms = absolute_terms(self._expression(expr, f"phase '{self.name}': the expression of integral(...)"))
        (factor, first), *others = ((factor, self._quantity("integral", term)) for factor, term in terms)
        whole = first if factor == 1.0 else factor * first
        return sum((factor * one for factor, one in others), whole)

    def peak(self, expr: Any) -> ca.MX:
        """The maximum over time of an expression of the phase's symbols, for use in objectives and constraints.

        It may be minimised or bounded above; a minimum over time is `-peak(-expr)`.
        """
        return self._quantity("peak", expr)

    def split(self, condition: ca.MX, *, first: bool | None = None, name: str | None = None) -> Phase:
        """Cut the phase in two where a condition of its states switches, at a free time, so that nothing in either part jumps there.

        This phase ends where both sides of the comparison are equal; the phase that is returned goes on from there. In each, its value on
        that side replaces the condition, and a path constraint keeps the phase there. Call it after `dynamics` and all paths, and before
        `tf`, `final`, `integral`, `peak` and links to later phases are used. The second phase may be split again, by another condition.

        Parameters
        ----------
        condition : MX
            A comparison as in `casadi.if_else(x > 0, ...)`, with which rates or path constraints switch.
        first : bool, optional
            Its value before the switch; by default what it is at the initial states, as far as these tell.
        name : str, optional
            Of the second phase; by default that of this one and "after".

        Returns
        -------
        Phase
            The second one, with states and controls of its own of the same names: `after["x"]`.
        """
        place = f"phase '{self.name}'"
        if not isinstance(condition, ca.MX) or condition.op() not in COMPARISONS or condition.numel() != 1:
            raise ValueError(f"{place}: a phase is split where one comparison switches, such as x > 0, not at {condition}")
        starts = {self._symbols[name].__hash__(): limits for name, limits in self._initial.items()}
        side = value_at(condition, starts) if first is None else first
        parts = sides(self._varying(), lambda node: (float(bool(side)), float(not side)) if same(node, condition) else None)
        if not parts[2]:
            raise ValueError(f"{place}: no rate and no path constraint has the condition {condition}; write it as it is written there")
        if side is None:
            raise ValueError(f"{place}: the initial states do not tell whether {condition} holds at first; say it: split(..., first=True)")
        difference = condition.dep(0) - condition.dep(1)
        after = self._cut(parts, (self._t0_range[0], self._tf_range[1]), name)
        word = f"side of {condition}"
        for phase, below in ((self, side), (after, not side)):
            (own,) = ca.substitute([difference], [*self._symbols.values()], [*phase._symbols.values()])
            phase.path(word, own, upper=0.0 if below else None, lower=None if below else 0.0)
        self._owner.constraint(f"{place} ends at {condition}", self.final(difference), lower=0.0, upper=0.0)
        return after

    def break_at(self, time: float, *, name: str | None = None) -> Phase:
        """Cut the phase in two at a known time, where something jumps: an element ends there. Otherwise as `split`."""
        when = checks.number(time, f"phase '{self.name}': the time of a break")
        if not self._t0_range[1] < when < self._tf_range[0]:
            raise ValueError(
                f"phase '{self.name}' need not last from before {when:g} until after it: t0 {self._t0_range}, tf {self._tf_range}"
            )
        return self._cut(sides(self._varying(), lambda node: at_time(node, self.time, when)), (when, when), name)

    def _varying(self) -> dict[str, ca.MX]:
        """Rates and path constraints by name."""
        return self._rates | {name: expr for name, (_, expr) in self._paths.items()}

    def _cut(self, parts: tuple[dict[str, ca.MX], dict[str, ca.MX], int], when: tuple[float, float], name: str | None) -> Phase:
        """The second of two parts of the phase, whose expressions are given; the phase itself becomes the first."""
        place, owner = f"phase '{self.name}'", self._owner
        stated = [*parts[0].values(), *(expr for _, expr in (*owner._objectives.values(), *owner._constraints.values()))]
        ends = {self.t0.__hash__(), self.tf.__hash__()} & {symbol.__hash__() for expr in stated for symbol in ca.symvar(expr)}
        later = any(list(owner._phases).index(self.name) == first for first, _ in owner._links)
        if ends or later or any(self._quantities[kind] for kind in _KINDS if kind != "initial"):
            raise ValueError(f"{place}: cut it before its times, values at the end, integrals, peaks and links to later phases are used")
        after: Phase = owner.phase(name or f"{self.name} after", t0=when, tf=self._tf_range, time_unit=self._time_unit)
        for word, v in self._states.items():
            after.state(word, bounds=(v.lower, v.upper), final=self._final[word], unit=v.unit, scale=v.scale)
            self._final[word] = (v.lower, v.upper)
        for word, v in self._controls.items():
            after.control(word, bounds=(v.lower, v.upper), unit=v.unit, scale=v.scale, period=v.period)
        old, new = ([*phase._symbols.values(), phase.time] for phase in (self, after))
        ours, theirs = parts[0], dict(zip(parts[1], ca.substitute(list(parts[1].values()), old, new), strict=True))
        after._rates = {word: theirs[word] for word in self._rates}
        self._rates = {word: ours[word] for word in self._rates}
        for word, (limit, _) in list(self._paths.items()):
            self._paths[word], after._paths[word] = (limit, ours[word]), (limit, theirs[word])
        # A straight line is a guess of the whole phase.
        self._guesses = {word: guess for word, guess in self._guesses.items() if not (isinstance(guess, tuple) and np.ndim(guess) == 1)}
        after._guesses = {word: guess for word, guess in self._guesses.items() if word != "t0"}
        self._guesses.pop("tf", None)
        self._tf_range = when
        owner.link(self, after)
        if self._duration != (0.0, float("inf")):
            (low, high), self._duration = self._duration, (0.0, float("inf"))
            owner.constraint(f"duration of {self.name}", after.tf - self.t0, lower=low, upper=high if np.isfinite(high) else None)
        return after

    def guess(self, **values: Any) -> None:
        """Set initial guesses of states, controls, `t0` and `tf` by name: a number, a pair (at t0, at tf), or (absolute times, values)."""
        times = {word: Variable(word, *limits) for word, limits in (("t0", self._t0_range), ("tf", self._tf_range))}
        known = self._states | self._controls | times
        for name, value in values.items():
            what = f"phase '{self.name}': the guess of '{name}'"
            if name not in known:
                raise ValueError(f"{what}: there is no such state, control or time; there are {', '.join((*self._symbols, *times))}")
            given = checks.number(value, what) if name in times else checks.guess(value, what)
            self._guesses[name] = checks.guessed(given, known[name], what)

    def _new_name(self, kind: str, name: str) -> str:
        taken = {*self._symbols, *self._paths, "time", "t0", "tf"}
        return checks.new_name(kind, name, taken, f"phase '{self.name}'")

    def _new_symbol(self, name: str) -> ca.MX:
        symbol = self._symbols[name] = ca.MX.sym(name)
        self._hashes.add(symbol.__hash__())
        return symbol

    def _expression(self, value: Any, what: str) -> ca.MX:
        groups = {"states": self._states, "controls": self._controls, "parameters": self._parameters}
        every = self._symbols | dict(self._parameters)
        symbols = {kind: {name: every[name] for name in group} for kind, group in groups.items()}
        value = named(value, symbols | {"time": {"time": self.time}}, what)
        own = self._hashes, {symbol.__hash__() for symbol in self._parameters.values()}
        hint = f"which is neither a state, control or time of phase '{self.name}' nor a parameter of problem '{self._problem}'"
        return checks.expression(value, own, what, hint)

    def _quantity(self, kind: str, expr: Any) -> ca.MX:
        inner = self._expression(expr, f"phase '{self.name}': the expression of {kind}(...)")
        symbol = ca.MX.sym(f"{kind}({inner}) of {self.name}")
        self._quantities[kind].append((symbol, inner))
        self._quantity_hashes.add(symbol.__hash__())
        return symbol

    def _with_used(self, symbols: list[ca.MX]) -> Phase:
        """A copy with those quantities only whose symbols are used."""
        other, used = copy(self), {symbol.__hash__() for symbol in symbols}
        other._quantities = {kind: [one for one in those if one[0].__hash__() in used] for kind, those in self._quantities.items()}
        return other

    def _check_rates(self, given: Any) -> None:
        if set(given) != set(self._states):
            raise ValueError(f"phase '{self.name}': dynamics given for [{', '.join(given)}], states are [{', '.join(self._states)}]")

    def _quantity_symbols(self) -> list[ca.MX]:
        """Symbols of this phase for objectives and constraints, in the order of `CompiledPhase.n_quantities`."""
        return [self.t0, self.tf, *(symbol for kind in _KINDS for symbol, _ in self._quantities[kind])]

    def _constants(self) -> set[int]:
        """Hashes of the values at the ends, and peaks, of constants."""
        kinds = (kind for kind in _KINDS if kind != "integral")
        return {symbol.__hash__() for kind in kinds for symbol, inner in self._quantities[kind] if not ca.symvar(inner)}

    def _labels(self) -> dict[str, list[str]]:
        """Labels of the rows of each compiled Function."""
        place = f"phase '{self.name}'"
        functions = {"initials": "initial", "finals": "final", "integrands": "integral", "peaks": "peak"}
        return {
            "dynamics": [f"{place}: the rate of '{name}'" for name in self._states],
            "path": [f"path '{name}' of {place}" for name in self._paths],
            **{word: [f"{place}: {kind}({inner})" for _, inner in self._quantities[kind]] for word, kind in functions.items()},
        }

    def _compile(self) -> CompiledPhase:
        """Plain data and Functions; ranges as stated, before links narrow them."""
        if not self._states:
            raise ValueError(f"phase '{self.name}' has no state")
        self._check_rates(self._rates)
        groups = {
            "x": [self._symbols[name] for name in self._states],
            "u": [self._symbols[name] for name in self._controls],
            "t": [self.time],
            "s": [self.t0, self.tf, *self._parameters.values()],
        }

        def function(name: str, expressions: list[ca.MX]) -> ca.Function:
            return vector_function(name, groups, expressions)

        integrands = [expr for _, expr in self._quantities["integral"]]
        roots = {row: inner for row, inner in enumerate(map(radicand, integrands)) if inner is not None}
        sizes = roots | {row: expr.dep(0) for row, expr in enumerate(integrands) if expr.is_op(ca.OP_FABS)}

        parts = [branches(expr) for _, expr in self._quantities["peak"]]

        varying = [*self._varying().values(), *integrands, *(expr for _, expr in self._quantities["peak"])]
        fixed = all(lower == upper for lower, upper in (self._t0_range, self._tf_range))

        return CompiledPhase(
            name=self.name,
            time_unit=self._time_unit,
            t0=Variable("t0", *self._t0_range, self._time_unit),
            tf=Variable("tf", *self._tf_range, self._time_unit),
            duration=self._duration,
            states=tuple(self._states.values()),
            controls=tuple(self._controls.values()),
            initial=tuple(self._initial.values()),
            final=tuple(self._final.values()),
            paths=tuple(limit for limit, _ in self._paths.values()),
            guesses=dict(self._guesses),
            dynamics=function("dynamics", list(self._rates.values())),
            path=function("path", [expr for _, expr in self._paths.values()]),
            initials=function("initials", [expr for _, expr in self._quantities["initial"]]),
            finals=function("finals", [expr for _, expr in self._quantities["final"]]),
            integrands=function("integrands", integrands),
            peaks=function("peaks", [expr for _, expr in self._quantities["peak"]]),
            peak_parts=function("peak_parts", [one for own in parts for one in own]),
            peak_of=tuple(k for k, own in enumerate(parts) for _ in own),
            sizes=function("sizes", list(sizes.values())),
            sized=tuple(sizes),
            switching=switching(groups, varying, [self.time, self.t0, self.tf]),
            roots=tuple(row in roots for row in sizes),
            corners=corners(varying, self.time, (self._t0_range[0], self._tf_range[0])) if fixed else (),
        )
