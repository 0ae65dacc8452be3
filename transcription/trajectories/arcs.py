"""Arcs of trajectories, integrated independently of the transcription, many at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

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
MOST_CALLS = 200_000
"""Evaluations of the dynamics on one element after which an integration by one method counts as broken down."""
SIMULATION_GRACE = 1.0
"""Seconds that integrations have left when the work is asked to end: most are over by then, so that what was found is still checked."""


@dataclass(frozen=True, eq=False)
class Arcs:
    """n arcs of one phase, each an element of a trajectory, with controls of one basis and degree."""

    phase: CompiledPhase
    begins: np.ndarray  # begins, lengths: (n,): In time
    lengths: np.ndarray
    coefficients: np.ndarray  # (n, degree + 1, nu): Of the controls
    basis: str
    s: np.ndarray  # (n, ns): t0, tf and the parameters of the trajectory

    @classmethod
    def of(cls, phase: CompiledPhase, pieces: Sequence[tuple[PhaseTrajectory, int, np.ndarray]]) -> Arcs:
        """Of (trajectory, element, parameters), with controls of one basis and degree."""
        edges = np.array([one.state.edges[j : j + 2] for one, j, _ in pieces])
        laws = np.array([one.control.coefficients[j] for one, j, _ in pieces])
        s = np.array([[one.t0, one.tf, *parameters] for one, _, parameters in pieces])
        return cls(phase, edges[:, 0], edges[:, 1] - edges[:, 0], laws, pieces[0][0].control.basis, s)

    def integrate(self, y: np.ndarray, rtol: float, atol: np.ndarray, method: str) -> np.ndarray:
        """States and integrals along all arcs. y (n, ny), atol (ny,) -> (n, len(DENSE)."""
        check_stopping(SIMULATION_GRACE)
        found = np.full((len(y), len(DENSE), y.shape[1]), np.nan)
        self._calls[0] = 0
        able = np.flatnonzero(np.isfinite(y).all(axis=1))
        if len(able):
            rates = self._some(able)._rates(-1.0, y[able].ravel()).reshape(len(able), -1)
            able = able[np.isfinite(rates).all(axis=1)]
        groups = [able] if method in EXPLICIT else [able[k : k + 1] for k in range(len(able))]
        while groups:
            group = groups.pop()
            arcs = self._some(group)
            values = arcs._integrated(y[group], rtol, atol, method) if len(group) else None
            if values is None and len(group) == 1 and method in EXPLICIT and arcs._calls[0] > MOST_CALLS:
                # Stiff: the steps of an explicit method are as short as its fastest decay, those of an implicit one as the solution lets.
                arcs._calls[0] = 0
                values = arcs._integrated(y[group], rtol, atol, STIFF)
            if values is not None:
                found[group] = values
            elif len(group) > 1:
                # One that breaks down takes the others with it: look for it.
                groups += np.array_split(group, 2)
        return found

    def _some(self, rows: np.ndarray) -> Arcs:
        """The arcs of `rows`, in their order: itself, with its rates, if these are all."""
        if len(rows) == len(self.begins):
            return self
        return Arcs(self.phase, self.begins[rows], self.lengths[rows], self.coefficients[rows], self.basis, self.s[rows])

    def _integrated(self, y: np.ndarray, rtol: float, atol: np.ndarray, method: str) -> np.ndarray | None:
        """All together; None if the integration breaks down."""
        n, ny = y.shape
        # The integrator bounds the mean square over all arcs, of which any one may have as much of the error as this leaves it.
        share = np.sqrt(n)
        options = {"rtol": max(rtol / share, 3e-14), "atol": np.tile(atol / share, n), "t_eval": DENSE}
        try:
            # What grows beyond all numbers is a break down, which is reported as such, and no warning of numpy's.
            with np.errstate(over="ignore", invalid="ignore"):
                solution = solve_ivp(self._rates, (-1.0, 1.0), y.ravel(), method=method, **options)
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            # The implicit methods raise where rates are no numbers; so do ours after too many evaluations.
            return None
        return solution.y.T.reshape(len(DENSE), n, ny).swapaxes(0, 1) if solution.success else None

    @cached_property
    def _calls(self) -> list[int]:
        """Number of evaluations of the rates since the last integration began."""
        return [0]

    @cached_property
    def _rates(self) -> Callable[[float, np.ndarray], np.ndarray]:
        """(tau, y (n * ny,)) -> rates by the local coordinate, called through buffers: some thousand calls a trajectory."""
        n, nx, nu = len(self.begins), len(self.phase.states), len(self.phase.controls)
        function, degree = _rate_function(self.phase, n), self.coefficients.shape[1] - 1
        laws = np.ascontiguousarray(self.coefficients.swapaxes(0, 1)).reshape(degree + 1, n * nu)
        # As sums of powers they cost a tenth of the time; up to this degree the digits that this loses are few.
        law = monomials(self.basis, degree) @ laws if degree <= 12 else None
        exponents, line = np.arange(degree + 1), np.ones(2)
        half, half_of_each = 0.5 * self.lengths[:, None], 0.5 * self.lengths
        x, u, time = np.zeros((n, nx)), np.zeros((n, nu)), np.zeros(n)
        out = np.zeros((n, function.size1_out(0)))
        arguments = x, u, time, np.array(self.s, dtype=float)
        buffer, trigger = function.buffer()
        for i, argument in enumerate(arguments):
            buffer.set_arg(i, memoryview(argument))  # type: ignore[arg-type,call-arg]
        buffer.set_res(0, memoryview(out))  # type: ignore[arg-type,call-arg]
        controls, basis, begins = self.phase.controls, self.basis, self.begins
        periodic, calls = any(v.period for v in controls), self._calls
        flat_x, flat_u = x.ravel(), u.ravel()

        def rates(tau: float, y: np.ndarray, _alive: object = (buffer, arguments)) -> np.ndarray:
            # The buffer holds bare addresses: `_alive` keeps what they point to as long as this function lives.
            calls[0] += 1
            if calls[0] > MOST_CALLS:
                raise ArithmeticError("too many evaluations of the dynamics")
            if not calls[0] % 100:  # some hundredths of a second
                check_stopping(SIMULATION_GRACE)
            # Written into place: an operation of numpy on a few numbers takes longer than the dynamics.
            if n == 1:
                flat_x[:] = y[:nx]
            else:
                x[:] = y.reshape(n, -1)[:, :nx]
            np.multiply(half_of_each, tau + 1.0, out=time)
            np.add(begins, time, out=time)
            if law is None:
                u[:] = (basis_matrix(basis, degree, np.array([tau])) @ laws).reshape(n, nu)
            elif degree == 1:
                line[1] = tau
                np.matmul(line, law, out=flat_u)
            else:
                np.matmul(tau**exponents, law, out=flat_u)
            if periodic:
                u[:] = wrapped(u, controls)
            trigger()
            reraise()
            return (half * out).ravel()

        return rates


@remembered
def _rate_function(phase: CompiledPhase, n: int) -> ca.Function:
    """(x, u, t, s) -> rates of the states and of the integrals, in n columns."""
    inputs = [ca.MX.sym(name, phase.dynamics.size1_in(i)) for i, name in enumerate("xuts")]
    rates = ca.vertcat(phase.dynamics(*inputs), phase.integrands(*inputs))
    function = expanded(ca.Function("rates", inputs, [ca.densify(rates)]))
    return mapped(function, n) if n > 1 else function
