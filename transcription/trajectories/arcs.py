"""Arcs of trajectories, integrated independently of the transcription, many at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from scipy.integrate import DOP853, solve_ivp

from problems.compiled import CompiledPhase, remembered
from problems.externals import reraise
from problems.layers import mapped

from ..numerics.batched import expanded
from ..numerics.polynomials import basis_matrix, monomials
from ..stopping import check_stopping
from .limits import DENSE
from .trajectory import PhaseTrajectory, wrapped

EXPLICIT = ("RK23", "RK45", "DOP853")
METHODS = (*EXPLICIT, "Radau", "BDF", "LSODA")
"""Those that are implicit solve for all arcs in one dense system, so that each arc is integrated alone."""
STIFF = "Radau"
"""The method for arcs on which an explicit one has used up `MOST_CALLS`."""
STAGES, TERMS = np.concatenate([DOP853.C, [1.0], DOP853.C_EXTRA]), 3 + len(DOP853.D)
"""Of DOP853: where in a step its stages are, with the end and those for the interpolant, and how many terms that has."""
POWERS = "powers"
"""Basis of controls as sums of powers."""
MOST_CALLS = 200_000
"""Evaluations of the dynamics on one element after which an integration by one method counts as broken down."""
SIMULATION_GRACE = 1.0
"""Seconds that integrations have left when the work is asked to end: most are over by then, so that what was found is still checked."""


@dataclass(frozen=True, eq=False)
class Arcs:
    """Trajectories of one phase along N elements each, with controls of one basis and degree: n arcs side by side, then the next n."""

    phase: CompiledPhase
    begins: np.ndarray  # begins, lengths: (N, n): In time
    lengths: np.ndarray
    coefficients: np.ndarray  # (N, n, degree + 1, nu): Of the controls
    basis: str  # of `polynomials.BASES`, or POWERS
    s: np.ndarray  # (n, ns): t0, tf and the parameters of the trajectories
    _calls: list[int] = field(default_factory=lambda: [0])  # evaluations of the rates since the last integration began

    @classmethod
    def of(cls, phase: CompiledPhase, planned: Sequence[PhaseTrajectory], parameters: Sequence[np.ndarray]) -> Arcs:
        """Of trajectories with as many elements and controls of one basis and degree, each with its parameters."""
        edges = np.stack([one.state.edges for one in planned], axis=1)
        laws = np.stack([one.control.coefficients for one in planned], axis=1)
        s = np.array([[one.t0, one.tf, *values] for one, values in zip(planned, parameters, strict=True)])
        basis, degree = planned[0].control.basis, laws.shape[2] - 1
        if degree <= 12:  # they cost a tenth of the time, and the digits that this loses are few
            basis, laws = POWERS, monomials(basis, degree) @ laws
        return cls(phase, edges[:-1], np.diff(edges, axis=0), laws, basis, s)

    def alone(self, elements: np.ndarray | slice = slice(None)) -> Arcs:
        """The elements of one trajectory, or some of them, side by side: each by itself."""
        begins, lengths, laws = (one[elements].swapaxes(0, 1) for one in (self.begins, self.lengths, self.coefficients))
        return Arcs(self.phase, begins, lengths, laws, self.basis, np.tile(self.s, (begins.shape[1], 1)))

    def integrate(self, y: np.ndarray, rtol: float, atol: np.ndarray, method: str) -> np.ndarray:
        """States and integrals (N, n, len(DENSE), ny) along all elements, from y (n, ny). atol (ny,)."""
        found = np.full((len(self.begins), len(y), len(DENSE), y.shape[1]), np.nan)
        for j, values in enumerate(found):
            check_stopping(SIMULATION_GRACE)
            able = np.flatnonzero(np.isfinite(y).all(axis=1))
            groups = [able][: len(able)] if method in EXPLICIT else [able[k : k + 1] for k in range(len(able))]
            while groups:
                arcs = self._some(group := groups.pop())
                own = arcs._on_element(j, y[group], rtol, atol, method)
                if own is None and len(group) == 1 and method in EXPLICIT and arcs._calls[0] > MOST_CALLS:
                    # Stiff: the steps of an explicit method are as short as its fastest decay.
                    own = arcs._on_element(j, y[group], rtol, atol, STIFF)
                if own is not None:
                    values[group] = own
                elif len(group) > 1:
                    # One that breaks down takes the others with it: look for it.
                    groups += np.array_split(group, 2)
            y = values[:, -1]
        return found

    def _some(self, rows: np.ndarray) -> Arcs:
        """The arcs of `rows`, in their order: itself, with its functions, if these are all."""
        if len(rows) == len(self.s):
            return self
        begins, lengths, laws = (one[:, rows] for one in (self.begins, self.lengths, self.coefficients))
        return Arcs(self.phase, begins, lengths, laws, self.basis, self.s[rows])

    def _on_element(self, j: int, y: np.ndarray, rtol: float, atol: np.ndarray, method: str) -> np.ndarray | None:
        """All together, (n, len(DENSE), ny); None if the integration breaks down."""
        n, ny = y.shape
        # The integrator bounds the mean square over all arcs, of which any one may have as much of the error as this leaves it.
        rtol, atol = max(rtol / np.sqrt(n), 3e-14), atol / np.sqrt(n)
        self._calls[0] = 0
        try:
            # What grows beyond all numbers is a break down, which is reported as such, and no warning of numpy's.
            with np.errstate(over="ignore", invalid="ignore"):
                if method == "DOP853":
                    return self._stepped(j, y, rtol, atol)
                rates = self._rates(j)
                if not np.isfinite(rates(-1.0, y.ravel())).all():
                    return None
                options = {"rtol": rtol, "atol": np.tile(atol, n), "t_eval": DENSE}
                solution = solve_ivp(rates, (-1.0, 1.0), y.ravel(), method=method, **options)
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            # The implicit methods raise where rates are no numbers; so do ours after too many evaluations.
            return None
        return solution.y.T.reshape(len(DENSE), n, ny).swapaxes(0, 1) if solution.success else None

    def _stepped(self, j: int, y: np.ndarray, rtol: float, atol: np.ndarray) -> np.ndarray | None:
        """See `_on_element`: by the steps, errors and interpolants of scipy's DOP853, whose stages are one call of a Function."""
        (known, u, times, step_in_time, out), evaluate = self._steps
        known[:], half = y, 0.5 * self.lengths[j]
        # A first step that is short seldom passes over a kink without noticing, and later ones are soon longer.
        tau, step, most, taus, parts = -1.0, 0.05, 10.0, list[float](), list[np.ndarray]()
        while tau < 1.0:
            step, last = min(step, 1.0 - tau), tau + step >= 1.0
            self._count(len(STAGES))
            if step < 10.0 * math.ulp(tau):
                return None
            places = tau + step * STAGES
            u[:], times[:] = self._controls(j, places), self.begins[j] + np.outer(places + 1.0, half)
            step_in_time[:] = half * step
            evaluate()
            scale = atol + rtol * np.maximum(np.abs(known), np.abs(known + out[0]))
            fifth, third = ((out[TERMS:] / scale) ** 2).sum(axis=(1, 2)).tolist()
            error = fifth / math.sqrt((fifth + 0.01 * third) * known.size) if fifth else 0.0
            error = error if math.isfinite(fifth + third) else math.inf
            change = 0.9 * error**-0.125 if error else most
            if error < 1.0:
                taus, parts = [*taus, tau], [*parts, np.concatenate([known[None], out[:TERMS]])]
                known += out[0]
                tau, step, most = 1.0 if last else tau + step, step * min(change, most), 10.0
            else:  # or no number
                step, most = step * max(0.2, change), 1.0
        begun = np.array(taus)
        which = np.searchsorted(begun, DENSE, side="right") - 1
        x = (DENSE - begun[which]) / np.diff(np.append(begun, 1.0))[which]
        shares = np.cumprod([np.ones(len(x)), *(1.0 - x if k % 2 else x for k in range(TERMS))], axis=0)
        return np.einsum("kt,tkny->nty", shares, np.array(parts)[which])

    @cached_property
    def _steps(self) -> tuple[tuple[np.ndarray, ...], Callable[[], None]]:
        """Arrays that a step reads and writes, and the step."""
        n, ny, k = len(self.s), len(self.phase.states) + self.phase.integrands.numel_out(), len(STAGES)
        y, u, times, h = (np.zeros(size) for size in ((n, ny), (k, n, len(self.phase.controls)), (k, n), n))
        out = np.zeros((TERMS + 2, n, ny))
        return (y, u, times, h, out), _in_place(_step_function(self.phase, n), (y, u, times, np.array(self.s, dtype=float), h), out)

    def _count(self, more: int) -> None:
        """Count evaluations of the rates: too many raise ArithmeticError, and now and then it is asked whether the work is to end."""
        before, self._calls[0] = self._calls[0], self._calls[0] + more
        if self._calls[0] > MOST_CALLS:
            raise ArithmeticError("too many evaluations of the dynamics")
        if self._calls[0] // 100 > before // 100:  # some hundredths of a second
            check_stopping(SIMULATION_GRACE)

    def _controls(self, j: int, places: np.ndarray) -> np.ndarray:
        """Controls (k, n, nu) at local coordinates (k,) of element j."""
        laws, degree = self.coefficients[j], self.coefficients.shape[2] - 1
        values = places[:, None] ** np.arange(degree + 1) if self.basis == POWERS else basis_matrix(self.basis, degree, places)
        return wrapped((values @ laws).swapaxes(0, 1), self.phase.controls)

    def _rates(self, j: int) -> Callable[[float, np.ndarray], np.ndarray]:
        """(tau, y (n * ny,)) -> rates by the local coordinate on element j, called through buffers."""
        n, nx, nu = len(self.s), len(self.phase.states), len(self.phase.controls)
        begins, half = self.begins[j], 0.5 * self.lengths[j]
        x, u, time, out = (np.zeros(size) for size in ((n, nx), (n, nu), n, (n, nx + self.phase.integrands.numel_out())))
        evaluate = _in_place(_rate_function(self.phase, n), (x, u, time, np.array(self.s, dtype=float)), out)

        def rates(tau: float, y: np.ndarray) -> np.ndarray:
            self._count(1)
            x[:], u[:] = y.reshape(n, -1)[:, :nx], self._controls(j, np.array([tau]))[0]
            time[:] = begins + half * (tau + 1.0)
            evaluate()
            return (half[:, None] * out).ravel()

        return rates


def _in_place(function: ca.Function, arguments: Sequence[np.ndarray], out: np.ndarray) -> Callable[[], None]:
    """A call of a Function that reads arrays and writes into another one."""
    buffer, trigger = function.buffer()
    for i, argument in enumerate(arguments):
        buffer.set_arg(i, memoryview(argument))  # type: ignore[arg-type,call-arg]
    buffer.set_res(0, memoryview(out))  # type: ignore[arg-type,call-arg]

    def evaluate(_alive: object = (buffer, arguments, out)) -> None:
        # The buffer holds bare addresses: `_alive` keeps what they point to as long as this function lives.
        trigger()
        reraise()

    return evaluate


@remembered
def _rate_function(phase: CompiledPhase, n: int) -> ca.Function:
    """(x, u, t, s) -> rates of the states and of the integrals, in n columns."""
    inputs = [ca.MX.sym(name, phase.dynamics.size1_in(i)) for i, name in enumerate("xuts")]
    rates = ca.vertcat(phase.dynamics(*inputs), phase.integrands(*inputs))
    function = expanded(ca.Function("rates", inputs, [ca.densify(rates)]))
    return mapped(function, n) if n > 1 else function


@remembered
def _step_function(phase: CompiledPhase, n: int) -> ca.Function:
    """(y, u and times at the stages, s, step in time) -> terms of the interpolant, the first of which is the change of y, and two errors,
    a column each; of n arcs, at one stage after the other."""
    rates, nx, ny, k = _rate_function(phase, n), len(phase.states), _rate_function(phase, 1).numel_out(), len(STAGES)
    sizes = {"y": (ny, n), "u": (len(phase.controls), n * k), "t": (1, n * k), "s": rates.size_in(3), "h": (1, n)}
    y, u, t, s, h = inputs = [ca.MX.sym(name, *size) for name, size in sizes.items()]
    factors, slopes = ca.repmat(h, ny, 1), ca.MX(y.numel(), 0)
    for i, weights in enumerate([*DOP853.A, DOP853.B, *DOP853.A_EXTRA]):
        x = y + ca.reshape(slopes @ weights[:i], *y.shape) if i else y
        some = slice(i * n, (i + 1) * n)
        slopes = ca.horzcat(slopes, ca.vec(factors * rates(x[:nx, :], u[:, some], t[:, some], s)))
    first, change, last = slopes[:, 0], slopes[:, :12] @ DOP853.B, slopes[:, 12]
    terms = [change, first - change, 2.0 * change - first - last, slopes @ DOP853.D.T]
    errors = [slopes[:, :13] @ weights for weights in (DOP853.E5, DOP853.E3)]
    step = ca.Function("step", inputs, [ca.densify(ca.horzcat(*terms, *errors))])
    return step if n > 1 else expanded(step)
