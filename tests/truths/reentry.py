"""Reference fronts of the re-entry cases by gradients: the program that made the tables beside the cases.

    python tests/truths/reentry.py reentry_case1 [--points 120] [--out FILE.csv]

Each point is a solve from a place between the ends of the front straight down to it (Pascoletti and Serafini 1984), on a fine mesh with
controls that are linear on each element, with limits a little narrower than the case's own. Its controls, rounded as in the table, are
simulated by DOP853. The objectives of the table are those simulated; points that then exceed a limit of the case by more than 1 % are left
out. Half of the places lie within the corner in which the paper measures hypervolume.

The first solves begin at the guess. In a harder case they begin at those points of the first case that are feasible there too: these are
optimal there as well and are taken over, and they pass all zones on a side that is open, while a start with a zone in its way is seldom
solved. The first case in turn takes over those points of the other tables that its own do not dominate; all of them are feasible in it.
"""

import argparse
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import moocore
import numpy as np

from macs.evaluation.evaluator import CONVERGED
from macs.gradients.multistart import MultistartSolver
from macs.gradients.scalarised import GradientSolves, Scalarised
from macs.io.atomic import write_whole
from macs.io.console import Steps
from macs.pareto.directions import across, simplex_lattice
from macs.pareto.dominance import nondominated
from problems import load
from problems.cases import reentry
from problems.cases.reentry import NARROW, WIDE, ZONES, Limits
from problems.cases.winged import FOOT
from transcription import DFET
from transcription.nlp.scalarized import Solved
from transcription.trajectories.simulate import simulate
from transcription.trajectories.trajectory import Trajectory

CASES = {"reentry_case1": (WIDE, ()), "reentry_case2": (NARROW, ()), "reentry_case3": (WIDE, ZONES)}
EASIEST = "reentry_case1"
METHOD = DFET(60, 2, control_order=1, basis="bernstein")
CORNER = np.array([-28.5, 150.0, 1.5, 200.0])
"""Where the paper measures hypervolume from, minimised."""
NARROWER, NEARER = 0.98, 0.7
"""Limits (that of the load, which is the sharpest, twice) and tolerances of the solves, as factors of the case's own: a margin for
the errors of the mesh between its nodes."""
ALIKE = 1e-2
"""Flights whose objectives differ by less than this part of their ranges are one."""
ALLOWED = 0.01
"""Share by which a flight may exceed a limit, or a tolerance at the end."""
DIGITS = 2
"""Of the commands, in degrees."""
DIVISIONS, BEYOND = 12, 1.3
"""Of the lattice of places, and how far it reaches: fronts bulge beyond the simplex between their ends."""
RTOL = 1e-8


class Truth:
    """The front of a case as it becomes known."""

    def __init__(self, case: str) -> None:
        limits, zones = CASES[case]
        self.limits = limits
        tolerances = {"altitude_tolerance": 3000 * FOOT, "speed_tolerance": 350 * FOOT, "angle_tolerance": np.radians(1.0)}
        strict = reentry.reentry(
            case,
            Limits(NARROWER * limits.heating_rate, NARROWER * limits.dynamic_pressure, NARROWER**2 * limits.load_factor),
            [replace(zone, radius=zone.radius / NARROWER**0.5) for zone in zones],
            **{name: NEARER * value for name, value in tolerances.items()},
        )
        self.case = load(case).compile()
        self.nlp = METHOD.transcribe(strict)
        self.template = self.nlp.unpack(self.nlp.first_guess(self.nlp.guess[None])[0])
        self.descents = MultistartSolver(self.nlp, None, 1, np.random.default_rng(0), GradientSolves(1e-6))
        self.found: list[Solved] = []

    @property
    def F(self) -> np.ndarray:
        """Objectives (k, 4) of the flights that are known, minimised."""
        return np.array([solved.F for solved in self.found])

    def solve(self, start: np.ndarray, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray) -> Solved:
        """One solve, remembered if it converges."""
        solved = self.descents.from_vector(start, Scalarised(reference, weights, ceiling))
        if solved.status == CONVERGED:
            self.found.append(solved)
        return solved

    def begin(self, steps: Steps) -> None:
        """The best of each objective, from the guess."""
        start = self.nlp.first_guess(self.nlp.guess[None])[0]
        for i in range(4):
            steps.begin(f"objective {i + 1}")
            self.solve(start, np.where(np.arange(4) == i, 0.0, np.inf), np.eye(4)[i], np.full(4, np.inf))

    def inherit(self, steps: Steps, rows: np.ndarray) -> None:
        """Take over the flights of an easier case (k, 4 + n) that are feasible in this one, and so optimal, and good to start from."""
        for row in rows:
            steps.begin(f"cross-range {row[0]:.2f}")
            if row[3] <= (1 + ALLOWED) * self.limits.heating_rate:
                simulated = simulate(self.case, with_commands(self.template, row[4:]), rtol=RTOL, atol=RTOL)
                if simulated.violation <= ALLOWED:
                    z = self.nlp.interpolate(simulated.trajectory)
                    self.found.append(Solved(z, row[:4] * SIGNS, float(self.nlp.evaluate(z[None])[1][0]), CONVERGED, 0))
        print(f"{len(self.found)} of {len(rows)} flights of {EASIEST} are feasible")

    def ends(self, steps: Steps, ceiling: np.ndarray) -> np.ndarray:
        """The best of each objective within a ceiling, and then all others as good as may be: objectives (4, 4).

        Raises RuntimeError if the best of an objective is not found.
        """
        rows = []
        for i in range(4):
            steps.begin(f"end {i + 1}")
            F = self.F
            nearest = int(np.lexsort((F[:, i], np.maximum(F - ceiling, 0.0).sum(axis=1)))[0])
            alone = np.where(np.arange(4) == i, 0.0, np.inf)
            first = self.solve(self.found[nearest].z, alone, np.eye(4)[i], ceiling)
            if first.status != CONVERGED:
                raise RuntimeError(
                    f"best '{self.case.goals[i].name}': {first.status}, violation {first.violation:.1e}; no table is written"
                )
            limit = np.where(np.arange(4) == i, first.F[i] + 1e-6 * abs(first.F[i]), ceiling)
            others = np.where(np.arange(4) == i, np.inf, first.F)
            second = self.solve(first.z, others, np.maximum(np.ptp(F, axis=0), 1e-3), limit)
            rows.append(second.F if second.status == CONVERGED else first.F)
        return np.array(rows)

    def fill(self, steps: Steps, count: int, ceiling: np.ndarray) -> None:
        """Go down from places that are far from all that is known."""
        ends = self.ends(steps, ceiling)
        ideal, ranges = ends.min(axis=0), np.maximum(np.ptp(ends, axis=0), 1e-6)
        lattice = simplex_lattice(4, DIVISIONS)
        middle = np.full((1, 4), 0.25)
        places = across(((middle + BEYOND * (lattice - middle)) @ ends - ideal) / ranges)
        tried = np.empty((0, 4))
        for _ in range(count):
            F = self.F
            F = F[(F - ceiling <= 1e-9).all(axis=1)]
            known = np.vstack([across((F - ideal) / ranges), tried])
            place = places[np.argmax(np.linalg.norm(places[:, None] - known, axis=2).min(axis=1))]
            tried = np.vstack([tried, place])
            reference = ideal + ranges * place
            steps.begin(f"place {np.round(reference, 2).tolist()}")
            self.solve(self.nearest(reference, ranges, ceiling), reference, ranges, ceiling)

    def nearest(self, reference: np.ndarray, ranges: np.ndarray, ceiling: np.ndarray) -> np.ndarray:
        """The best that is known for a place, a vector (n,)."""
        F = self.F
        merit = np.max((F - reference) / ranges, axis=1) + (np.maximum(F - ceiling, 0.0) / ranges).sum(axis=1)
        return self.found[int(np.argmin(merit))].z

    def rows(self, steps: Steps) -> list[np.ndarray]:
        """Simulated points (k, 4 + n): objectives as the user sees them and controls in degrees; none dominated or beyond a limit."""
        F = self.F
        kept = np.flatnonzero(nondominated(np.round(F / np.maximum(np.ptp(F, axis=0), 1e-9) / 1e-5)))
        kept = kept[apart(F[kept])]
        rows = []
        for k in kept:
            steps.begin(f"flight {k}")
            trajectory, commands = rounded(self.nlp.unpack(self.found[k].z))
            simulated = simulate(self.case, trajectory, rtol=RTOL, atol=RTOL)
            if simulated.violation <= ALLOWED:
                rows.append(np.array([*simulated.objectives.values(), *commands]))
        infeasible = len(kept) - len(rows)
        print(f"{len(self.found)} solves converged, {len(kept)} of them not dominated, {infeasible} of these not feasible as simulated")
        return rows


SIGNS = np.array([-1.0, 1.0, 1.0, 1.0])


def apart(F: np.ndarray) -> np.ndarray:
    """Rows (k, 4), minimised, without those that are like another one; the best of each objective come before others. Their indices."""
    y = F / np.maximum(np.ptp(F, axis=0), 1e-9)
    kept = list(dict.fromkeys(np.argmin(F, axis=0).tolist()))
    for k in range(len(y)):
        if np.linalg.norm(y[kept] - y[k], axis=1).min() > ALIKE:
            kept.append(k)
    return np.sort(kept)


def rounded(flight: Trajectory) -> tuple[Trajectory, np.ndarray]:
    """A flight with commands of as many digits as the table has, and these: (elements, both ends, both angles) in a row."""
    commands = np.round(np.degrees(flight["entry"].control.coefficients), DIGITS).ravel()
    return with_commands(flight, commands), commands


def with_commands(flight: Trajectory, commands: np.ndarray) -> Trajectory:
    """A flight with other commands, in degrees."""
    phase = flight["entry"]
    control = replace(phase.control, coefficients=np.radians(commands).reshape(phase.control.coefficients.shape))
    return replace(flight, phases=(replace(phase, control=control),))


def made(case: str, points: int) -> np.ndarray:
    """The table of a case; see the module."""
    truth = Truth(case)
    if case == EASIEST:
        with Steps(f"{case}, to begin with", 4) as steps:
            truth.begin(steps)
    else:
        easier = table(EASIEST)
        with Steps(f"{case}, flights of {EASIEST}", len(easier)) as steps:
            truth.inherit(steps, easier)
    windows = [np.full(4, np.inf), CORNER]
    with Steps(case, 4 * len(windows) + points) as steps:
        for window in windows:
            truth.fill(steps, points // len(windows), window)
    with Steps(f"{case}, simulated", len(truth.found)) as steps:
        rows = truth.rows(steps)
    if case == EASIEST:
        for harder in CASES:
            rows += list(table(harder)) if harder != EASIEST else []
    return united(rows)


def table(case: str) -> np.ndarray:
    """The table of a case (k, 4 + n)."""
    with files("problems.cases").joinpath(f"{case}.csv").open() as file:
        return np.loadtxt(file, delimiter=",", ndmin=2)


def united(rows: list[np.ndarray]) -> np.ndarray:
    """The rows that none dominates, by their cross-range."""
    front = np.unique(np.array(rows), axis=0)
    front = front[nondominated(front[:, :4] * SIGNS)]
    return front[np.argsort(-front[:, 0])]


def text(case: str, rows: np.ndarray) -> str:
    """The table as text, with a header."""
    head = [
        f"{case}: front by gradients, each row a flight; made by: python tests/truths/reentry.py {case}",
        f"Solved on {METHOD}, limits times {NARROWER:g}, tolerances at the end times {NEARER:g};",
        "simulated by DOP853 with the commands of the row, which exceeds no limit of the case by more than 1 %.",
        "Columns: cross-range deg, heat load kBtu/ft2, oscillation rad, peak heating rate Btu/ft2/s; then, in degrees, the commands of",
        f"angle of attack and bank angle at both ends of each of {METHOD.elements} equal parts of the time, linear between.",
    ]

    def shown(row: np.ndarray) -> str:
        commands = (f"{value + 0.0:.{DIGITS}f}".rstrip("0").rstrip(".") for value in row[4:])
        return ",".join([*(f"{value:.7g}" for value in row[:4]), *commands])

    return "\n".join([*(f"# {line}" for line in head), *map(shown, rows)]) + "\n"


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Make the table of a re-entry case's true front again.")
    parser.add_argument("case", choices=CASES)
    parser.add_argument("--points", type=int, default=120)
    parser.add_argument("--out")
    given = parser.parse_args()
    rows = made(given.case, given.points)
    write_whole(given.out or Path(reentry.__file__).with_name(f"{given.case}.csv"), text(given.case, rows).encode())
    volume = moocore.hypervolume(np.ascontiguousarray(rows[:, :4] * SIGNS), ref=CORNER)
    print(f"{given.case}: {len(rows)} points, hypervolume {volume:.1f} in the paper's units, from the paper's corner")
    for k, row in enumerate(rows[[np.argmin(rows[:, k] * SIGNS[k]) for k in range(4)], :4]):
        print(f"  best objective {k + 1}: {np.round(row, 4).tolist()}")


if __name__ == "__main__":
    main()
