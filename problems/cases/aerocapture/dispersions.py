"""Capsules under dispersions of the entry angle, the density of the air and the ballistic coefficient: many cases of each at once.

The motion is planar, in time:

    dh/dt = v sin g,  dv/dt = -rho v^2 / (2 B) - mu / r^2 sin g,  dg/dt = rho v u / (2 B) + (v / r - mu / (r^2 v)) cos g,

with the ballistic coefficient B and the lift over drag that points upward, u. With r that of the interface these are eqs. (6)-(11) of
Armellin and Lavagna, as in `passage`; with r = R + h those of `winged` over a planet that does not turn, in which altitude, speed and path
angle depend on no other state and on the cosine of the bank angle alone.

Dormand and Prince, "A family of embedded Runge-Kutta formulae", Journal of Computational and Applied Mathematics 6, 1980: each case has
steps of its own, so it makes no difference which others are flown with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import radians
from typing import NamedTuple

import numpy as np
from scipy.integrate import RK45

from ... import checks
from .mars import MARS, heating_rate, shield_fraction
from .passage import PASSAGE

FLOOR, FARTHEST = 10e3, 10_000e3
"""Altitude below which a capsule is lost, and that of the farthest apoapsis that counts as captured, m: chosen."""
SCALES = np.array([MARS.scale_height, 1e3, 0.1, 1e3])[:, None]
"""Of altitude, speed, path angle and heat load, for the error of a step."""
TOLERANCE = 1e-9
"""Error of a step, in scales."""
LONGEST, FIRST = 30.0, 5.0
"""Longest and first step, s."""
STEPS = 5_000
"""Most steps of a case; 80 to 160 are usual."""
ON_TARGET = 1.0
"""How near the apoapsis is to the target where the bank is solved anew, m."""
TRIALS = 80
"""Most flights for that; 14 are usual."""
STRIDE = 0.01
"""First change of the lift over drag in that search."""

TABLEAU, TIMES = (*(row[: i + 1] for i, row in enumerate(RK45.A[1:])), RK45.B), (*RK45.C[1:], 1.0)

Lift = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(rows (k,), times (k,)) -> lift over drag that points upward (k,)."""


@dataclass(frozen=True)
class Capsule:
    """A design, and how it flies."""

    ballistic: float  # Mass over drag area, kg/m2.
    lift_to_drag: float  # Lift over drag.
    nose: float  # Nose radius, m.
    entry_angle: float  # Path angle at the entry, rad.
    bank: float | Callable[[np.ndarray], np.ndarray]  # Bank angle, rad: constant, or over times (k,) in s since the entry.
    # Whether gravity and curvature change with the altitude, as in `winged`, or are those of the interface, as in `passage`.
    curved: bool = False
    entry_speed: float = PASSAGE.entry_speed  # m/s.

    def upward(self, rows: np.ndarray, times: np.ndarray) -> np.ndarray:
        """The lift over drag that points upward, as `Lift`."""
        bank = self.bank(times) if callable(self.bank) else np.full(len(times), self.bank)
        return self.lift_to_drag * np.cos(bank)


@dataclass(frozen=True)
class Dispersions:
    """Normal distributions, their standard deviations, and how many cases are drawn."""

    entry_angle: float = 0.1  # deg.
    density: float = 0.1  # Of a factor of the density.
    ballistic: float = 0.02  # Of a factor of the ballistic coefficient.
    cases: int = 1_000
    seed: int = 0

    def __post_init__(self) -> None:
        for name, most in (("entry_angle", 1.0), ("density", 0.2), ("ballistic", 0.2)):
            checks.check_interval(f"dispersions: {name}", getattr(self, name), f"[0, {most:g}]")
        for name, least in (("cases", 1), ("seed", 0)):
            checks.check_count(f"dispersions: {name}", getattr(self, name), least)

    def __str__(self) -> str:
        shares = f"{100 * self.density:.3g} % of the density, {100 * self.ballistic:.3g} % of the ballistic coefficient"
        return f"{self.cases:,} cases by seed {self.seed}, {self.entry_angle:g} deg of the entry angle, {shares}"

    def draw(self) -> Cases:
        """The cases, the same for all designs: differences between these are then not those of the draws."""
        normal = np.random.default_rng(self.seed).standard_normal((3, self.cases))
        angle, density, ballistic = normal
        # Factors that are not positive are five standard deviations away or more.
        return Cases(
            radians(self.entry_angle) * angle,
            np.maximum(1.0 + self.density * density, 0.01),
            np.maximum(1.0 + self.ballistic * ballistic, 0.01),
        )


@dataclass(frozen=True)
class Cases:
    """Arrays (k,): added to the entry angle, rad; factors of the density and of the ballistic coefficient."""

    entry_angle: np.ndarray
    density: np.ndarray
    ballistic: np.ndarray

    def __len__(self) -> int:
        return len(self.entry_angle)

    def __getitem__(self, rows: np.ndarray) -> Cases:
        return Cases(self.entry_angle[rows], self.density[rows], self.ballistic[rows])


NOMINAL = Cases(np.zeros(1), np.ones(1), np.ones(1))


@dataclass(frozen=True)
class Exits:
    """How cases leave the air: arrays (k,); of those that do not, NaN."""

    speed: np.ndarray  # At the interface, m/s.
    path_angle: np.ndarray  # There, rad.
    heat: np.ndarray  # Heat load at the stagnation point of a nose of 1 m, J/cm2.
    lowest: np.ndarray  # Least altitude, m.


def inverse_apoapsis(speed: np.ndarray, path_angle: np.ndarray) -> np.ndarray:
    """Target radius over the apoapsis radius after an exit. It is continuous from ellipses to hyperbolas, of which it is negative."""
    momentum = MARS.entry_radius * speed * np.cos(path_angle)
    excess = speed**2 * MARS.entry_radius / MARS.mu
    eccentricity = np.hypot((excess - 1.0) * np.cos(path_angle), np.sin(path_angle))
    return np.asarray(MARS.target_radius * MARS.mu * (1.0 - eccentricity) / momentum**2)


@dataclass(frozen=True)
class DispersedOutcome:
    """What becomes of cases: arrays (k,)."""

    # Whether a case leaves the air on an ellipse whose apoapsis is no farther than `FARTHEST`. Of others, the columns below are NaN.
    captured: np.ndarray
    lost: np.ndarray  # Whether it does not leave the air.
    on_target: np.ndarray | None  # Whether its apoapsis is within `ON_TARGET` of the target orbit; None where no bank is solved.
    apoapsis_error: np.ndarray  # Altitude of the apoapsis above the target orbit, km.
    delta_v: np.ndarray  # Of the two burns to the target orbit, m/s: see `two_burns`.
    shield: np.ndarray  # Heat shield that its heat load asks for, % of the mass.
    lowest: np.ndarray  # Least altitude, km.
    upward: np.ndarray | None = None  # Lift over drag that points upward, where it is solved.

    def measures(self) -> dict[tuple[str, str], float | None]:
        """By name and unit: shares of the cases, and of those that are captured the 99th percentile, P99, of what should be small, and
        the first of the altitude; None if no case is captured."""
        found: dict[tuple[str, str], float | None] = {}
        for name, mask in (("captured", self.captured), ("lost in the air", self.lost), ("on target", self.on_target)):
            if mask is not None:
                found[name, "%"] = 100.0 * float(mask.mean())
        worst = {
            ("apoapsis error, P99", "km"): (np.abs(self.apoapsis_error), 99.0),
            ("delta v, P99", "m/s"): (self.delta_v, 99.0),
            ("TPS mass fraction, P99", "%"): (self.shield, 99.0),
            ("lowest altitude, P1", "km"): (self.lowest, 1.0),
        }
        for what, (values, percent) in worst.items():
            found[what] = float(np.percentile(values[self.captured], percent)) if self.captured.any() else None
        return found


def outcomes(capsules: Sequence[Capsule], dispersions: Dispersions) -> list[dict[str, DispersedOutcome]]:
    """Of each capsule the nominal case alone, and all cases in both ways: `with_same_bank` and `with_solved_bank`."""
    cases = dispersions.draw()
    ways = {"nominal": (with_same_bank, NOMINAL), "bank as it is": (with_same_bank, cases), "bank solved anew": (with_solved_bank, cases)}
    return [{name: way(capsule, some) for name, (way, some) in ways.items()} for capsule in capsules]


def with_same_bank(capsule: Capsule, cases: Cases) -> DispersedOutcome:
    """The cases with the bank angle of the nominal one, or its profile over time."""
    return _outcome(capsule, fly(capsule, cases, capsule.upward))


def with_solved_bank(capsule: Capsule, cases: Cases) -> DispersedOutcome:
    """The cases, each with the constant bank angle that brings its apoapsis to the target orbit.

    More lift upward leaves the air earlier and faster, with a higher apoapsis. A case in which all the lift is not enough is flown with all
    of it in the right direction, and is not `on_target`.

    Raises RuntimeError: a root is not found where there must be one.
    """
    upward = _solved_lift(capsule, cases)
    return _outcome(capsule, fly(capsule, cases, _constant(upward)), upward)


def two_burns(speed: np.ndarray, path_angle: np.ndarray) -> np.ndarray:
    """Delta v to the circular target orbit, m/s, after exits on ellipses: the first burn, at the apoapsis, brings the other apsis to the
    target radius, and the second one there makes the orbit a circle.

    Lu, Cerimele, Tigges and Matz, "Optimal aerocapture guidance", Journal of Guidance, Control, and Dynamics 38(4), 2015. With
    the apoapsis on the target it is `mars.circularisation`.
    """
    goal = MARS.target_radius
    apoapsis = goal / inverse_apoapsis(speed, path_angle)
    slow = MARS.entry_radius * speed * np.cos(path_angle) / apoapsis
    between = apoapsis + goal
    first = np.abs(np.sqrt(2.0 * MARS.mu * goal / (apoapsis * between)) - slow)
    return np.asarray(first + np.abs(np.sqrt(2.0 * MARS.mu * apoapsis / (goal * between)) - np.sqrt(MARS.mu / goal)))


def _outcome(capsule: Capsule, exits: Exits, upward: np.ndarray | None = None) -> DispersedOutcome:
    inverse = inverse_apoapsis(exits.speed, exits.path_angle)
    goal = MARS.target_radius
    # False for NaN, too.
    captured = inverse >= goal / (MARS.radius + FARTHEST)
    columns = np.full((4, len(inverse)), np.nan)
    speed, path, heat, lowest = (values[captured] for values in (exits.speed, exits.path_angle, exits.heat, exits.lowest))
    error = goal / inverse[captured] - goal
    columns[:, captured] = error / 1e3, two_burns(speed, path), shield_fraction(heat / capsule.nose**0.5), lowest / 1e3
    miss, delta_v, shield, least = columns
    on_target = None if upward is None else np.abs(miss) <= 1e-3 * ON_TARGET
    return DispersedOutcome(captured, np.isnan(inverse), on_target, miss, delta_v, shield, least, upward)


def _constant(upward: np.ndarray) -> Lift:
    """The same lift over drag all the time, of each row its own."""
    return lambda rows, times: upward[rows]


def _solved_lift(capsule: Capsule, cases: Cases) -> np.ndarray:
    """The lift over drag (k,) with which each case's apoapsis is on the target orbit, or the limit beyond which it would be.

    From the nominal one outward in strides that double until the root is between two, then by regula falsi in the Illinois form, or by
    halving where one of the two is lost.
    """
    k, most = len(cases), abs(capsule.lift_to_drag)
    near = 0.5 * ON_TARGET / MARS.target_radius
    start = 0.0 if callable(capsule.bank) else capsule.lift_to_drag * float(np.cos(capsule.bank))
    # At `low` the apoapsis is below the target, or the case is lost: infinite. At `high` it is above.
    low, high, below, above = (np.full(k, np.nan) for _ in range(4))
    upward, strides, last = np.full(k, start), np.full(k, STRIDE), np.zeros(k)
    active = np.arange(k)
    for _ in range(TRIALS):
        trial = upward[active]
        exits = fly(capsule, cases[active], _constant(trial))
        excess = inverse_apoapsis(exits.speed, exits.path_angle) - 1.0
        excess = np.where(np.isnan(excess), np.inf, excess)
        under = excess > 0.0
        done = (np.abs(excess) <= near) | (under & (trial >= most)) | (~under & (trial <= -most))
        active, trial, excess, under = active[~done], trial[~done], excess[~done], under[~done]
        if not len(active):
            return upward
        side = np.where(under, 1.0, -1.0)
        again = side == last[active]
        last[active] = side
        low[active[under]], below[active[under]] = trial[under], excess[under]
        high[active[~under]], above[active[~under]] = trial[~under], excess[~under]
        above[active[under & again]] *= 0.5
        below[active[~under & again]] *= 0.5
        a, b, fa, fb = low[active], high[active], below[active], above[active]
        with np.errstate(invalid="ignore"):
            falsi = (a * fb - b * fa) / (fb - fa)
        between = np.where(np.isfinite(falsi), falsi, 0.5 * (a + b))
        open_ended = np.isnan(a) | np.isnan(b)
        upward[active] = np.where(open_ended, np.clip(trial + side * strides[active], -most, most), between)
        strides[active] *= 2.0
    raise RuntimeError(f"no constant bank found in {TRIALS} flights for {len(active)} of {k} cases")


class _Steps(NamedTuple):
    """Steps of some cases: states (4, m), altitude, speed, path angle and heat load, with their rates, at the beginning; times and lengths
    of the steps (m,); which of the cases they are; states at the end."""

    states: np.ndarray
    rates: np.ndarray
    times: np.ndarray
    lengths: np.ndarray
    rows: np.ndarray
    ends: np.ndarray

    def only(self, which: np.ndarray) -> _Steps:
        return _Steps(*(values[..., which] for values in self))


def fly(capsule: Capsule, cases: Cases, lift: Lift) -> Exits:
    """The way of each case through the air, from the interface until it leaves it or is lost: below `FLOOR`, or too slow to rise again.

    Raises RuntimeError: a case takes more than `STEPS` steps.
    """
    k = len(cases)
    motion = _Motion(capsule, MARS.density * cases.density, capsule.ballistic * cases.ballistic, lift)
    begin = np.stack([np.full(k, MARS.interface), np.full(k, capsule.entry_speed), capsule.entry_angle + cases.entry_angle, np.zeros(k)])
    rows, times = np.arange(k), np.zeros(k)
    steps = _Steps(begin, motion.rates(begin, times, rows), times, np.full(k, FIRST), rows, begin)
    level: list[_Steps] = []
    last: list[_Steps] = []
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        for _ in range(STEPS):
            ends, end_rates, error = motion.step(steps, steps.lengths)
            steps = steps._replace(ends=ends)
            good = error <= 1.0
            out = good & (ends[0] >= MARS.interface)
            level.append(steps.only(good & (steps.states[2] < 0.0) & (ends[2] >= 0.0)))
            last.append(steps.only(out))
            # An error that is no number: of a step that is far too long.
            factor = np.where(np.isfinite(error), 0.9 * np.maximum(error, 1e-10) ** -0.2, 0.2)
            steps = _Steps(
                np.where(good, ends, steps.states),
                np.where(good, end_rates, steps.rates),
                np.where(good, steps.times + steps.lengths, steps.times),
                np.minimum(steps.lengths * np.clip(factor, 0.2, 5.0), LONGEST),
                steps.rows,
                ends,
            ).only(~(out | (good & motion.lost(ends))))
            if not len(steps.rows):
                break
        else:
            raise RuntimeError(f"{len(steps.rows)} of {k} cases did not end in {STEPS} steps")
        found, lowest = np.full((4, k), np.nan), np.full(k, MARS.interface)
        leaving, levelling = (_Steps(*(np.concatenate(part, axis=-1) for part in zip(*kept, strict=True))) for kept in (last, level))
        found[:, leaving.rows] = motion.until(0, MARS.interface, leaving)
        np.minimum.at(lowest, levelling.rows, motion.until(2, 0.0, levelling)[0])
    return Exits(found[1], found[2], found[3], np.where(np.isnan(found[0]), np.nan, lowest))


@dataclass(frozen=True)
class _Motion:
    """The equations of a capsule's cases, and steps along them."""

    capsule: Capsule
    density: np.ndarray
    ballistic: np.ndarray
    lift: Lift

    def rates(self, states: np.ndarray, times: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Rates (4, m) of some rows of the cases at times (m,)."""
        altitude, speed, path, _ = states
        density = self.density[rows] * np.exp((MARS.interface - altitude) / MARS.scale_height)
        radius = MARS.radius + altitude if self.capsule.curved else MARS.entry_radius
        gravity, sine = MARS.mu / radius**2, np.sin(path)
        drag = 0.5 * density * speed / self.ballistic[rows]
        rates = np.empty(states.shape)
        rates[0] = speed * sine
        rates[1] = -drag * speed - gravity * sine
        rates[2] = drag * self.lift(rows, times) + (speed / radius - gravity / speed) * np.cos(path)
        rates[3] = heating_rate(density, speed)
        return rates

    def lost(self, states: np.ndarray) -> np.ndarray:
        """Whether cases (m,) are below `FLOOR`, or have less energy than it takes to rise to the interface: drag only takes of it."""
        altitude, speed = states[:2]
        radius = MARS.radius + altitude if self.capsule.curved else MARS.entry_radius
        return np.asarray((altitude < FLOOR) | (0.5 * speed**2 < MARS.mu / (radius * MARS.entry_radius) * (MARS.interface - altitude)))

    def step(self, at: _Steps, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States and rates at the end of steps of other lengths (m,), and the errors, of which 1 is allowed."""
        stages = [at.rates]
        for weights, share in zip(TABLEAU, TIMES, strict=True):
            ends = at.states + lengths * sum(weight * stage for weight, stage in zip(weights, stages, strict=True) if weight)
            stages.append(self.rates(ends, at.times + share * lengths, at.rows))
        error = lengths * sum(weight * stage for weight, stage in zip(RK45.E, stages, strict=True) if weight)
        return ends, stages[-1], np.abs(error / (TOLERANCE * SCALES)).max(axis=0)

    def until(self, which: int, value: float, steps: _Steps) -> np.ndarray:
        """States where one of them has a value that it reaches within a step: Newton's method on the length of the step."""
        lengths = steps.lengths * (value - steps.states[which]) / (steps.ends[which] - steps.states[which])
        for _ in range(6):
            there, rates, _ = self.step(steps, lengths)
            lengths = np.clip(lengths - (there[which] - value) / rates[which], 0.0, steps.lengths)
        return there
