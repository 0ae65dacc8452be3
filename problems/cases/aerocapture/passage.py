"""The way through the air at a constant bank angle, from a hyperbola to an ellipse: a boundary value problem, for many capsules at once.

Armellin and Lavagna (see `mars`), eqs. (6)-(11), with two slips mended: eq. (9) is eps = sqrt(r_e / beta) rho_e S C_D / m, and lift grows
with the density y in eqs. (10) and (11). With z = ln y in place of y,

    dz/ds = -k sin g,  dx/ds = eps e^z + 2 (delta / k) e^x sin g,  dg/ds = (eps / 2) u e^z + (1 - delta e^x) cos g / k,

k = sqrt(beta r_e), x = 2 ln(v_e / v), and u = (C_L / C_D) cos(bank). The exit is known completely, so the path is followed from there, and
only u and the whole arc are unknown: z = x = 0 at the entry decides them. All that is asked of a passage depends on the ballistic
coefficient alone. Newton's method solves it on collocation at Gauss-Lobatto nodes: the states inside of the intervals are eliminated, then
those between them. Every ballistic coefficient takes Newton steps of its own: it makes no difference which others are solved with it.

For populations they are interpolated in the logarithm of the ballistic coefficient, on which alone they depend: `tabulated`. The nodes are
Chebyshev's over the whole of `RANGE`, and the values there are the solver's. Between them, too, it agrees with the solver to 1e-6 of each
value, and better: `tests/problems/aerocapture/test_passage.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache, cached_property

import numpy as np

from transcription.numerics.polynomials import lagrange_integrals, lagrange_matrix, monomials, nodes

from .mars import ARRIVAL_SPEED, EXIT_SPEED, MARS, entry_speed, exit_angle, heating_rate

RANGE = (5.0, 4000.0)
"""Ballistic coefficients for which passages are solved, kg/m2; those of the paper's capsules are 45 to 300."""
STRETCH = float(np.sqrt(MARS.entry_radius / MARS.scale_height))
"""k, the root of the interface's radius over the scale height."""
LENGTH = np.sqrt(MARS.entry_radius * MARS.scale_height)
"""Of a unit of the arc, m: ds = v dt over this, eq. (6)."""
INTERVALS, DEGREE = 8, 10
"""Of the collocation."""
POINTS = nodes("lobatto", DEGREE)
SUMS = lagrange_integrals(POINTS, POINTS)[1:]
"""Integrals of the Lagrange functions from the first of these nodes to each of the others, (degree, degree + 1)."""
STEPS = 40
"""Most Newton steps; 4 to 7 are usual."""
TOLERANCE = 1e-6
"""Of the last step, in shares of what one may change at most. Newton's method squares errors, so what is left is near rounding."""


@dataclass(frozen=True)
class Passage:
    """Statement of the boundary value problem."""

    arrival_speed: float = ARRIVAL_SPEED  # Excess speed of the hyperbola, m/s.
    exit_speed: float = EXIT_SPEED  # Speed at which the air is left, m/s.

    @cached_property
    def entry_speed(self) -> float:
        return entry_speed(self.arrival_speed)

    @cached_property
    def exit_angle(self) -> float:
        return exit_angle(self.exit_speed)

    @property
    def slowing(self) -> float:
        """x at the exit: twice the logarithm of entry speed over exit speed."""
        return 2.0 * float(np.log(self.entry_speed / self.exit_speed))

    @property
    def pull(self) -> float:
        """delta: gravity at the interface, over what a circle at the entry speed asks for; eq. (9)."""
        return MARS.mu / (MARS.entry_radius * self.entry_speed**2)


PASSAGE = Passage()


@dataclass(frozen=True)
class Passages:
    """What follows from ballistic coefficients: arrays (n,)."""

    ballistic: np.ndarray  # Mass over drag area, kg/m2.
    lift: np.ndarray  # u, the lift over drag that points upward.
    entry_angle: np.ndarray  # Path angle at the entry, rad.
    lowest: np.ndarray  # Least altitude, m.
    heat: np.ndarray  # Heat load at the stagnation point of a nose of 1 m, J/cm2; in general it is this over the root of the nose radius.
    arc: np.ndarray  # Whole arc s, eq. (6).


def passages(ballistic: np.ndarray, passage: Passage = PASSAGE) -> Passages:
    """The passages of ballistic coefficients (n,), kg/m2.

    Raises ValueError: one is outside `RANGE`. Raises RuntimeError: newton's method did not converge for one: it is named. It does for all
    with the paper's data; the nearer the exit is to level, the more lift heavy capsules would need to stay within the atmosphere, far more
    than they have.
    """
    bc = _within(ballistic)
    return _measured(bc, *_solved(bc, passage), passage)


TABLE_DEGREE = 20
COLUMNS = tuple(f.name for f in fields(Passages) if f.name != "ballistic")


def outside(ballistic: np.ndarray) -> np.ndarray:
    """Why there are no passages of ballistic coefficients (n,): text, empty where there are."""
    text = np.array([f"ballistic coefficient {one:g} kg/m2, outside {RANGE[0]:g} to {RANGE[1]:g}" for one in ballistic], object)
    return np.where((ballistic >= RANGE[0]) & (ballistic <= RANGE[1]), "", text)


def _within(ballistic: np.ndarray) -> np.ndarray:
    """Ballistic coefficients (n,) as an array; raises ValueError if one is outside `RANGE`."""
    bc = np.atleast_1d(np.asarray(ballistic, float))
    if reasons := [reason for reason in outside(bc) if reason]:
        raise ValueError(reasons[0])
    return bc


def tabulated(ballistic: np.ndarray, passage: Passage = PASSAGE) -> Passages:
    """The passages of ballistic coefficients (n,), kg/m2, from the table; it is made when it is first asked for.

    Raises ValueError: one is outside `RANGE`.
    """
    bc = _within(ballistic)
    places = 2.0 * np.log(bc / RANGE[0]) / np.log(RANGE[1] / RANGE[0]) - 1.0
    values = lagrange_matrix(nodes("chebyshev", TABLE_DEGREE), np.clip(places, -1.0, 1.0)) @ _table(passage)
    found = dict(zip(COLUMNS, values.T, strict=True))
    return Passages(bc, **found | {"heat": np.exp(found["heat"])})


@cache
def _table(passage: Passage) -> np.ndarray:
    """Values at the nodes (TABLE_DEGREE + 1, columns); of the heat load, its logarithm."""
    share = 0.5 * (nodes("chebyshev", TABLE_DEGREE) + 1.0)
    ballistic = RANGE[0] * (RANGE[1] / RANGE[0]) ** share
    solved = passages(np.clip(ballistic, *RANGE), passage)
    values = np.column_stack([np.log(solved.heat) if name == "heat" else getattr(solved, name) for name in COLUMNS])
    values.setflags(write=False)
    return values


@dataclass(frozen=True)
class PassageProfile:
    """A passage in time, from the entry to the exit: arrays (k,) of time, s, altitude, m, speed, m/s, path angle, rad, the angle flown over
    ground, rad, and the heat load until then of a nose of 1 m, J/cm2."""

    time: np.ndarray
    altitude: np.ndarray
    speed: np.ndarray
    path_angle: np.ndarray
    ground: np.ndarray
    heat: np.ndarray


def profile(ballistic: float, passage: Passage = PASSAGE) -> PassageProfile:
    """The passage of one ballistic coefficient, kg/m2, in time. Raises what `passages` does."""
    _, arc, Y = _solved(_within(np.asarray(ballistic)), passage)
    states = Y[0]
    speed = passage.entry_speed * np.exp(-0.5 * states[..., 1])
    altitude = MARS.interface - MARS.scale_height * states[..., 0]
    half = 0.5 * float(arc[0]) / INTERVALS

    def since_entry(rate: np.ndarray) -> np.ndarray:
        inside = half * (rate @ SUMS.T)
        until = np.cumsum(inside[:, -1])
        from_exit = inside + np.concatenate([[0.0], until[:-1]])[:, None]
        return until[-1] - np.append(0.0, from_exit.ravel())[::-1]

    def along(values: np.ndarray) -> np.ndarray:
        return np.append(values[0, 0], values[:, 1:].ravel())[::-1]

    return PassageProfile(
        since_entry(LENGTH / speed),
        along(altitude),
        along(speed),
        along(states[..., 2]),
        since_entry(LENGTH * np.cos(states[..., 2]) / (MARS.radius + altitude)),
        since_entry(_heating(speed, states[..., 0]) * LENGTH / speed),
    )


def _solved(bc: np.ndarray, passage: Passage) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lift (n,), arc (n,) and states (n, intervals, degree + 1, 3), from the exit to the entry; raises what `passages` does."""
    eps = LENGTH * MARS.density / bc  # eq. (9), mended
    lift, arc, Y = _guess(bc, eps, passage)
    active = np.arange(len(bc))
    for _ in range(STEPS):
        try:
            Y[active], arc[active], lift[active], size = _newton(Y[active], arc[active], lift[active], eps[active], passage)
        except np.linalg.LinAlgError as error:
            raise RuntimeError(f"no passage found for a ballistic coefficient of {_named(bc[active])}: {error}") from error
        active = active[size > TOLERANCE]
        if not len(active):
            return lift, arc, Y
    raise RuntimeError(f"no passage found for a ballistic coefficient of {_named(bc[active])} in {STEPS} Newton steps")


def _named(bc: np.ndarray) -> str:
    """The first few of ballistic coefficients, kg/m2."""
    return ", ".join(f"{one:g}" for one in bc[:3]) + (" or others" if len(bc) > 3 else "") + " kg/m2"


def _guess(bc: np.ndarray, eps: np.ndarray, passage: Passage) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lift, arc and states (n, intervals, degree + 1, 3) to begin with: two parabolas of z that meet where drag is greatest."""
    tau = (np.arange(INTERVALS)[:, None] + 0.5 * (POINTS + 1.0)) / INTERVALS
    # Measured once, for 120 kg/m2, with the change for e times as much.
    lift, arc = -0.146 - 0.02 * np.log(bc / 120.0), 18.4 + 2.75 * np.log(bc / 120.0)
    deepest, where = np.log(0.25 / eps), 0.72
    side = np.where(tau < where, where, 1.0 - where)
    share = (tau - where) / side
    Y = np.empty((len(bc), *tau.shape, 3))
    Y[..., 0] = deepest[:, None, None] * (1.0 - share**2)
    Y[..., 1] = passage.slowing * (1.0 - np.clip((tau - 0.5) / 0.4, 0.0, 1.0))
    Y[..., 2] = np.clip((deepest / (arc * STRETCH))[:, None, None] * (-2.0 * share / side), -0.2, 0.2)
    Y[:, 0, 0] = 0.0, passage.slowing, passage.exit_angle
    return lift, arc, Y


LARGEST = np.array([1.0, 0.5, 0.1]), 0.2, 0.05
"""Largest changes of a Newton step: of z, x and g, of the arc as a share of it, and of the lift."""


def _newton(Y: np.ndarray, arc: np.ndarray, lift: np.ndarray, eps: np.ndarray, passage: Passage) -> tuple[np.ndarray, ...]:
    """One Newton step from states Y (n, intervals, degree + 1, 3), whose intervals begin where the ones before end: states, arc and lift
    after it, and its size (n,), of which 1 is the largest that is taken whole."""
    n, m, q = len(Y), Y.shape[1], Y.shape[2] - 1
    rates, jacobian, by_lift = _rates(Y, lift, eps, passage)
    half = (0.5 * arc / m)[:, None, None, None]
    moved = half * (SUMS @ rates)
    # Inside of an interval: dY = P [dY at its beginning, d arc, d lift, 1].
    matrix = np.empty((n, m, q, 3, q, 3))
    inner = (half * SUMS[:, 1:])[..., None, None]
    np.multiply(-inner, jacobian[:, :, None, 1:], out=matrix.transpose(0, 1, 2, 4, 3, 5))
    matrix = matrix.reshape(n, m, 3 * q, 3 * q)
    matrix += np.eye(3 * q)
    right = np.empty((n, m, q, 3, 6))
    right[..., :3] = (half * SUMS[:, :1])[..., None] * jacobian[:, :, :1]
    right[..., :3] += np.eye(3)
    right[..., 3] = moved / arc[:, None, None, None]
    right[..., 4] = half * (SUMS @ by_lift)
    right[..., 5] = moved - (Y[:, :, 1:] - Y[:, :, :1])
    P = np.linalg.solve(matrix, right.reshape(n, m, 3 * q, 6))
    # Between the intervals, from the exit on, where nothing changes.
    begins = np.zeros((n, m + 1, 6, 3))
    begins[:, :, 3:] = np.eye(3)
    for i in range(m):
        np.matmul(P[:, i, -3:], begins[:, i], out=begins[:, i + 1, :3])
    entry = begins[:, m, :2]
    change = np.ones((n, 3, 1))
    change[:, :2] = np.linalg.solve(entry[:, :, :2], -Y[:, -1, -1, :2, None] - entry[:, :, 2:])
    step = (P @ (begins[:, :m] @ change[:, None])).reshape(n, m, q, 3)
    d_arc, d_lift = change[:, 0, 0], change[:, 1, 0]
    states = (np.abs(step) / LARGEST[0]).max(axis=(1, 2, 3))
    size = np.maximum(states, np.maximum(np.abs(d_arc) / (LARGEST[1] * arc), np.abs(d_lift) / LARGEST[2]))
    share = 1.0 / np.maximum(1.0, size)
    Y = Y.copy()
    Y[:, :, 1:] += share[:, None, None, None] * step
    Y[:, 1:, 0] = Y[:, :-1, -1]
    return Y, arc + share * d_arc, lift + share * d_lift, size


def _rates(Y: np.ndarray, lift: np.ndarray, eps: np.ndarray, passage: Passage) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates of the states along the arc from the exit back to the entry, their derivatives by the states, and by the lift."""
    k, air = STRETCH, eps[:, None, None] * np.exp(Y[..., 0])
    pull, sine, cosine = passage.pull * np.exp(Y[..., 1]), np.sin(Y[..., 2]), np.cos(Y[..., 2])
    upward = 0.5 * lift[:, None, None] * air
    rates, jacobian, by_lift = np.empty(Y.shape), np.zeros((*Y.shape, 3)), np.zeros(Y.shape)
    rates[..., 0], rates[..., 1] = k * sine, -air - 2.0 / k * pull * sine
    rates[..., 2] = -upward - (1.0 - pull) / k * cosine
    jacobian[..., 0, 2] = k * cosine
    jacobian[..., 1, 0], jacobian[..., 1, 1], jacobian[..., 1, 2] = -air, -2.0 / k * pull * sine, -2.0 / k * pull * cosine
    jacobian[..., 2, 0], jacobian[..., 2, 1], jacobian[..., 2, 2] = -upward, pull / k * cosine, (1.0 - pull) / k * sine
    by_lift[..., 2] = -0.5 * air
    return rates, jacobian, by_lift


def _measured(bc: np.ndarray, lift: np.ndarray, arc: np.ndarray, Y: np.ndarray, passage: Passage) -> Passages:
    speed = passage.entry_speed * np.exp(-0.5 * Y[..., 1])
    rate = _heating(speed, Y[..., 0]) * LENGTH / speed
    heat = 0.5 * arc / INTERVALS * (rate @ SUMS[-1]).sum(axis=1)
    lowest = MARS.interface - MARS.scale_height * _deepest(Y)
    return Passages(bc, lift, Y[:, -1, -1, 2].copy(), lowest, heat, arc)


def _heating(speed: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Heating rate of a nose of 1 m, W/cm2."""
    return heating_rate(MARS.density * np.exp(z), speed)


def _deepest(Y: np.ndarray) -> np.ndarray:
    """Greatest z (n,): where the path is level, by Newton's method on the polynomial of g in the interval in which its sign changes."""
    rows = np.arange(len(Y))
    inside = Y[rows, (Y[:, :, -1, 2] > 0.0).sum(axis=1)]
    z, g = inside[..., 0], inside[..., 2]
    tau = POINTS[z.argmax(axis=1)][:, None]
    # Sums of monomials, of which the degree is moderate enough.
    sums = monomials("lobatto", len(POINTS) - 1).T
    z, g, powers = z @ sums, g @ sums, np.arange(len(POINTS))
    for _ in range(4):
        value, slope = (g * tau**powers).sum(axis=1), (g[:, 1:] * powers[1:] * tau ** powers[:-1]).sum(axis=1)
        tau = np.clip(tau - (value / slope)[:, None], -1.0, 1.0)
    return (z * tau**powers).sum(axis=1)
