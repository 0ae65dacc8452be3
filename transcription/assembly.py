"""From the phases that a method writes to one NLP, for all transcriptions.

Times, parameters and links become variables, durations and the user's constraints rows, and the quantities of all phases meet in the
objectives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Link, Variable

from .base import NLP, ControlProfile, Transcription
from .numerics.batched import Batched, expanded
from .phases.adjoint import Adjoint, PhaseMultipliers
from .phases.layout import Layout
from .phases.reduced import Reduced
from .phases.rows import EndSlots, Parts, Rows
from .phases.writer import PhaseWriter, along, filled
from .stopping import check_stopping
from .trajectories.trajectory import PiecewisePolynomial, Trajectory

WriterFactory = Callable[[CompiledPhase, Layout, EndSlots], PhaseWriter]


class Assembly:
    """Lays out the variables of a problem and lets a method write each phase.

    Linked quantities share one variable, so that links are exact; only where several phases lead into the same one do the further links
    become rows.
    """

    def __init__(self, problem: CompiledProblem, writer: WriterFactory) -> None:
        self.problem = problem
        self.layout = Layout()
        self._joined: list[tuple[int, int, float, str]] = []
        self._links_into: list[list[Link]] = [[] for _ in problem.phases]
        for link in problem.links:
            self._links_into[link.second].append(link)
        self.parameters = np.array([self.layout.add(v, free=True) for v in problem.parameters], dtype=int)
        self._writers: dict[int, PhaseWriter] = {}
        for i in problem.order_in_time:
            check_stopping()
            self._writers[i] = writer(problem.phases[i], self.layout, self._ends(i))
        self._declared = [self._writers[i] for i in range(len(problem.phases))]
        self._peaks = [self._add_peaks(phase) for phase in problem.phases]
        self._least = np.concatenate([*self._peaks, *(writer.magnitudes for writer in self._declared)])

    def nlp(self, transcription: Transcription) -> NLP:
        """The whole NLP."""
        z = ca.MX.sym("z", len(self.layout.variables) + self.layout.hidden)
        extended = self.layout.extended_symbol(z)
        affine, rows = all(writer.affine for writer in self._declared), Rows()
        points = rows.points = [] if affine else None
        written = [self._write_phase(*one, extended, rows) for one in zip(self._declared, self._peaks, strict=True)]
        quantities, largest, magnitudes = zip(*written, strict=True)
        self._write_ties(extended, rows)
        linear = len(rows.expressions)
        q, of_quantities = ca.vertcat(*quantities, self.layout.pick(extended, self.parameters)), self._scores(quantities)
        F, values = of_quantities(q)
        for k, limit in enumerate(self.problem.limits):
            rows.add(values[k], limit.lower, limit.upper, limit.scale, f"constraint '{limit.name}'")

        def function(name: str, **outputs: ca.MX) -> ca.Function:
            """A Function of z, which has no symbols for the values at points."""
            columns = [ca.densify(column) for column in outputs.values()]
            if points:
                columns = ca.Function(name, [z, *(one.values for one in points)], columns).call([z, *(one.evaluated for one in points)])
            return ca.Function(name, [z], columns, ["z"], list(outputs))

        scores = function("nlp", F=F, g=ca.vertcat(*rows.expressions))
        largest_peaks = function("largest", peaks=ca.vertcat(*largest, *magnitudes))
        if not self.layout.hidden:
            largest_peaks = expanded(largest_peaks)
        self._largest = Batched(self._filled(largest_peaks))
        return NLP(
            problem=self.problem,
            transcription=transcription,
            variables=tuple(self.layout.variables),
            free=np.array(self.layout.free, dtype=int),
            functions=self._filled(scores),
            g_lower=np.concatenate(rows.lower),
            g_upper=np.concatenate(rows.upper),
            g_scale=np.concatenate(rows.scale),
            g_labels=tuple(rows.labels),
            guess=self.guess(),
            profiles=self.profiles(self.layout.free),
            guessed=self.guessed,
            reduce=lambda: self._reduced(function, rows, largest_peaks, scores),
            tighten=self.tighten,
            unpack=self.unpack,
            interpolate=self.interpolate,
            widen=self.widened,
            measure=lambda: self._filled(function("quantities", **{f"q{i}": one for i, one in enumerate(quantities)})),
            costates=partial(self.costates, rows),
            adjoint=partial(self.adjoint, rows),
            dense=sum(writer.dense for writer in self._declared),
            parts=None if points is None else Parts.of(z, points, ca.vertcat(*rows.expressions[:linear]), q, of_quantities),
        )

    def guess(self) -> np.ndarray:
        slots = zip(self.problem.parameters, self.parameters, strict=True)
        found = {int(slot): self.problem.guesses.get(v.name, np.nan) for v, slot in slots}
        for writer in self._writers.values():
            times = []
            for variable, slot in ((writer.phase.t0, writer.ends.t0), (writer.phase.tf, writer.ends.tf)):
                given = writer.phase.guesses.get(variable.name)
                if given is not None:
                    found[slot] = float(np.clip(given, variable.lower, variable.upper))
                times.append(found.get(slot, 0.5 * (variable.lower + variable.upper)))
            for state, (low, high), slot in zip(writer.phase.states, writer.phase.initial, writer.ends.initial, strict=True):
                if state.name in writer.phase.guesses:
                    t0, tf = np.array(times[:1]), np.array(times[1:])
                    given = along(writer.phase.guesses[state.name], t0, tf, np.zeros(1))
                    found.setdefault(int(slot), float(np.clip(given[0, 0], low, high)))
            found |= writer.guess_controls(*times)
        return np.array([found.get(slot, np.nan) for slot in self.layout.free])

    def widened(self, nlp: NLP) -> NLP:
        """What the user guessed of the states, or the line that stands for it, is a guess like others."""
        free = np.flatnonzero(np.isfinite(nlp.lower) & np.isfinite(nlp.upper))
        known = np.where(np.isfinite(nlp.guess), nlp.guess, 0.5 * (nlp.lower[nlp.free] + nlp.upper[nlp.free]))
        guess = self.guessed(known[None])[0]
        guess[nlp.free] = nlp.guess

        def guessed(candidates: np.ndarray) -> np.ndarray:
            Z = np.zeros((len(candidates), len(nlp.variables)))
            Z[:, free] = candidates
            return Z

        return replace(nlp, free=free, guess=guess[free], guessed=guessed, profiles=self.profiles(free.tolist(), states=True), widened=True)

    def profiles(self, free: Sequence[int], *, states: bool = False) -> tuple[ControlProfile, ...]:
        """See `NLP.profiles`, where these variables are `free`; with `states`, those of the states, too."""
        column = {slot: i for i, slot in enumerate(free)}
        found = []
        for writer in self._declared:
            tables = [(writer.phase.controls, *writer.control_nodes())]
            if states:
                slots, places = writer.state_nodes()
                in_time = np.argsort(places, kind="stable")
                tables.append((writer.phase.states, slots[in_time], places[in_time]))
            for variables, slots, places in tables:
                for variable, own in zip(variables, slots.T, strict=True):
                    # A control whose bounds coincide is no variable, and one that is constant for a while only one.
                    rows = np.sort(np.unique(own, return_index=True)[1])
                    rows = rows[np.isin(own[rows], free)]
                    if rows.size:
                        columns = np.array([column[int(slot)] for slot in own[rows]])
                        found.append(ControlProfile(f"{writer.phase.name}.{variable.name}", columns, places[rows]))
        return tuple(found)

    def guessed(self, candidates: np.ndarray) -> np.ndarray:
        Z = np.zeros((len(candidates), len(self.layout.variables)))
        Z[:, self.layout.free] = candidates
        extended = self.layout.extended(Z)
        for writer in self._writers.values():
            writer.guess(extended)
        return extended[:, : Z.shape[1]]

    def _filled(self, function: ca.Function) -> ca.Function:
        """A Function of the variables alone from one of these and the hidden quantities."""
        check_stopping()
        if not self.layout.hidden:
            return expanded(function)
        z = ca.MX.sym("z", len(self.layout.variables))
        extended = filled(list(self._writers.values()), self.layout.extended_symbol(z))
        values = function.call([extended[: z.numel() + self.layout.hidden]])
        return expanded(ca.Function(function.name(), [z], values, function.name_in(), function.name_out()))

    def _reduced(self, function: Callable[..., ca.Function], rows: Rows, peaks: ca.Function, scores: ca.Function) -> Reduced:
        """The constraints that propagation leaves to satisfy; `function` makes Functions of z."""
        left = [i for i, propagated in enumerate(rows.propagated) if not propagated]
        rest = expanded(function("rest", rest=ca.vertcat(ca.MX(0, 1), *(rows.expressions[i] for i in left))))
        lower, upper, scale = (np.concatenate([np.empty(0), *(values[i] for i in left)]) for values in (rows.lower, rows.upper, rows.scale))
        return Reduced(
            self.layout,
            list(self._writers.values()),
            (self._least, peaks),
            (rest, lower, upper, scale),
            # What depends on hidden quantities is evaluated where these are propagated; elsewhere on demand.
            (scores, rows.left) if self.layout.hidden else None,
        )

    def tighten(self, Z: np.ndarray) -> np.ndarray:
        if not len(self._least):
            return Z
        Z = Z.copy()
        Z[:, self._least] = self._largest(Z)[0]
        return Z

    def unpack(self, z: np.ndarray) -> Trajectory:
        extended = self.layout.extended(np.asarray(z, dtype=float)[None])[0]
        phases = tuple(writer.unpack(extended) for writer in self._declared)
        slots = zip(self.problem.parameters, self.parameters, strict=True)
        return Trajectory(phases, {v.name: v.meant(float(extended[slot])) for v, slot in slots})

    def costates(self, rows: Rows, z: np.ndarray, multipliers: np.ndarray) -> dict[str, PiecewisePolynomial]:
        extended = self.layout.extended(np.asarray(z, dtype=float)[None])[0]
        found = {w.phase.name: w.costates(extended, multipliers[rows.dynamics[w.phase.name]]) for w in self._declared}
        return {name: costates for name, costates in found.items() if costates is not None}

    def adjoint(
        self, rows: Rows, z: np.ndarray, of_rows: np.ndarray, of_bounds: np.ndarray, weights: Mapping[str, np.ndarray]
    ) -> dict[str, Adjoint]:
        extended, found = self.layout.extended(np.asarray(z, dtype=float)[None])[0], {}
        for writer in self._declared:
            name = writer.phase.name
            kinds = ("path", "peak", "state", "size")
            paths, peaks, states, sizes = ([of_rows[one] for one in rows.samples.get((name, kind), ())] for kind in kinds)
            multipliers = PhaseMultipliers(of_rows[rows.dynamics[name]], paths, peaks, states, sizes, weights[name], of_bounds)
            found[name] = _adjoint(writer, extended, multipliers)
        return found

    def interpolate(self, trajectory: Trajectory) -> np.ndarray:
        extended = self.layout.extended(np.zeros((1, len(self.layout.variables))))
        write = self.layout.write
        write(extended, self.parameters, np.array([[trajectory.parameters[v.name] for v in self.problem.parameters]]))
        for writer in self._writers.values():
            phase = trajectory[writer.phase.name]
            write(extended, writer.ends.statics[:2], np.array([[phase.t0, phase.tf]]))
            states = phase.edge_states
            write(extended, writer.ends.initial, states[None, 0])
            write(extended, writer.ends.final, states[None, -1])
            writer.interpolate(extended, phase)
        Z = extended[:, : len(self.layout.variables)]
        lower, upper = (np.array([getattr(v, side) for v in self.layout.variables]) for side in ("lower", "upper"))
        return self.tighten(np.clip(Z, lower, upper))[0]

    def _ends(self, i: int) -> EndSlots:
        """Slots of the ends of phase i: new variables, but for those that a link shares with a phase written before."""
        phase = self.problem.phases[i]
        prefix = f"{phase.name}."
        shared: dict[str, int] = {}
        for link in self._links_into[i]:
            before = self._writers[link.first]
            finals = {v.name: int(slot) for v, slot in zip(before.phase.states, before.ends.final, strict=True)}
            for name, slot in [("t0", before.ends.tf), *((state, finals[state]) for state in link.states)]:
                if name in shared and shared[name] != slot:
                    label = f"link from '{before.phase.name}' to '{phase.name}': {name}"
                    scale = before.phase.tf.scale if name == "t0" else next(v.scale for v in phase.states if v.name == name)
                    self._joined.append((shared[name], slot, scale, label))
                shared.setdefault(name, slot)

        def end(variable: Variable, word: str, limits: tuple[float, float], free: bool) -> int:
            if free and variable.name in shared:
                return shared[variable.name]
            return self.layout.add(replace(variable, name=f"{prefix}{variable.name}{word}", lower=limits[0], upper=limits[1]), free=free)

        slot_t0, slot_tf = (end(v, "", (v.lower, v.upper), True) for v in (phase.t0, phase.tf))
        initial = [end(v, "(t0)", limits, True) for v, limits in zip(phase.states, phase.initial, strict=True)]
        final = [end(v, "(tf)", limits, False) for v, limits in zip(phase.states, phase.final, strict=True)]
        return EndSlots(slot_t0, slot_tf, np.array(initial), np.array(final), self.parameters)

    def _add_peaks(self, phase: CompiledPhase) -> np.ndarray:
        """Slots of the phase's peaks: variables without bounds, of the largest size that the expression has anywhere."""
        count = phase.peaks.size1_out(0)
        if not count:
            return np.empty(0, dtype=int)
        groups = [phase.states, phase.controls, (phase.tf,), (phase.t0, phase.tf, *self.problem.parameters)]
        rng = np.random.default_rng(0)
        anywhere = [np.array([rng.uniform(v.lower, v.upper, 1024) for v in group]).reshape(-1, 1024) for group in groups]
        sizes = np.abs(np.array(phase.peaks(*anywhere)))
        scales = np.where(np.isfinite(sizes), sizes, 0.0).max(axis=1)
        names = [f"{phase.name}.peak[{k}]" for k in range(count)]
        variables = [Variable(name, -np.inf, np.inf, "", float(scale or 1.0)) for name, scale in zip(names, scales, strict=True)]
        return np.array([self.layout.add(variable) for variable in variables])

    def _write_phase(self, writer: PhaseWriter, peaks: np.ndarray, extended: ca.MX, rows: Rows) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Rows of one phase; its quantities q, the largest samples of its peaks, and its magnitudes."""
        check_stopping()
        phase, pick, written = writer.phase, self.layout.pick, writer.write(extended, rows)
        s = pick(extended, writer.ends.statics)
        first, last = pick(extended, writer.ends.initial), pick(extended, writer.ends.final)
        peak = pick(extended, peaks)
        for samples, k in zip(ca.vertsplit(written.peak_samples), phase.peak_of, strict=True):
            scale = self.layout.variables[peaks[k]].scale
            rows.add(samples - peak[k], -np.inf, 0, scale, f"peak of '{phase.name}'", propagated=True, of=(phase.name, "peak"))
        (initials,) = rows.at_points(phase.initials, first, written.first_control, s[0], s)
        (finals,) = rows.at_points(phase.finals, last, written.last_control, s[1], s)
        largest = [ca.mmax(written.peak_samples[[i for i, of in enumerate(phase.peak_of) if of == k], :]) for k in range(len(peaks))]
        q = ca.vertcat(s[0], s[1], initials, finals, written.integrals, peak)
        return q, ca.vertcat(*largest) if largest else ca.MX(0, 1), written.magnitudes

    def _scores(self, quantities: Sequence[ca.MX]) -> ca.Function:
        """The quantities of all phases, and the parameters, in one column -> (objectives, constraints)."""
        sizes = [*(q.numel() for q in quantities), len(self.parameters)]
        column = ca.MX.sym("q", sum(sizes))
        split = ca.vertsplit(column, np.cumsum([0, *sizes]).tolist())
        values = [ca.densify(function(*split)) for function in (self.problem.objectives, self.problem.constraints)]
        return expanded(ca.Function("scores", [column], values, ["q"], ["F", "c"]))

    def _write_ties(self, extended: ca.MX, rows: Rows) -> None:
        """Rows of durations, and of links that could not be shared."""
        for writer in self._declared:
            phase, (shortest, longest) = writer.phase, writer.phase.duration
            times = self.layout.pick(extended, writer.ends.statics[:2])
            if phase.tf.lower - phase.t0.upper < shortest or phase.tf.upper - phase.t0.lower > longest:
                span = phase.tf.upper - phase.t0.lower
                rows.add(times[1] - times[0], shortest, longest, span, f"duration of '{phase.name}'")
        for first, second, scale, label in self._joined:
            ends = self.layout.pick(extended, np.array([first, second]))
            rows.add(ends[0] - ends[1], 0, 0, scale, label)


def _adjoint(writer: PhaseWriter, extended: np.ndarray, multipliers: PhaseMultipliers) -> Adjoint:
    """The costates of one phase: by the adjoint equation where limits make them jump inside elements, else the method's own."""
    known = writer.costates(extended, multipliers.dynamics)
    if known is not None and not writer.limited(multipliers):
        return Adjoint(known)
    found = writer.swept(extended, multipliers)
    if known is None:
        return found
    # Only at t0 is the error one of the integration alone: elsewhere it is also that jumps are taken to lie at nodes.
    trusted = (found.error or 0.0) <= 1e-3
    return found.beside(known, np.array([v.scale for v in writer.phase.states])) if trusted else Adjoint(known)
