"""Both skip entries against Newton's law in vectors and the papers' figures, their ends flown again by code of its own, and a choice."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from vectors import cross

from macs import Front, Point, optimize, sweep
from macs.decisions import ReferencePoint, decide, trade_offs
from problems import load
from problems.cases.skip_entry import front as front_of
from transcription import stated
from transcription.nlp.scalarized import scalarize

DEGREE = math.pi / 180
LIMITS = [200, 13406.4583, 2.5]
START = [79248.0, 0.0, 0.0, 7802.88, -DEGREE, 90 * DEGREE, 90719.0]
STATES = ["altitude", "longitude", "latitude", "speed", "flight-path angle", "heading", "mass"]
CONTROLS = ["angle of attack", "bank angle", "thrust"]


@dataclass(frozen=True)
class Paper:
    """What is printed: planet, area, air, impulse, spin, the gain of the lags of the controls, and the heating rate, Btu/ft2/s."""

    radius: float
    mu: float
    area: float
    density: float
    height: float
    impulse: float
    spin: float
    gain: float
    heating: Callable[[float, float, float], float]

    def in_the_air(self, x: np.ndarray, a: float) -> tuple[float, float, float, list[float]]:
        """Lift, drag, gravity; heating rate, dynamic pressure, Pa, and load factor."""
        h, _, _, v, _, _, m = x[:7]
        rho, g = self.density * math.exp(-h / self.height), self.mu / (self.radius + h) ** 2
        q = 0.5 * rho * v**2
        lift, drag = q * self.area * (-0.2070 + 1.676 * a), q * self.area * (0.07854 - 0.3529 * a + 2.040 * a**2)
        return lift, drag, g, [self.heating(rho, v, a), q, math.hypot(lift, drag) / (m * g)]

    def rates(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Of the seven states, and of controls that lag, by Newton's law in the turning frame: minus 2 W x v and W x (W x r)."""
        h, lon, lat, v, path, heading, m = x[:7]
        a, bank, thrust = x[7:] if self.gain else u
        up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
        east = np.array([-math.sin(lon), math.cos(lon), 0.0])
        north = cross(up, east)
        level = math.sin(heading) * east + math.cos(heading) * north
        moving = v * (math.sin(path) * up + math.cos(path) * level)
        lift, drag, g, _ = self.in_the_air(x, a)
        # Across the motion: up in the vertical plane, and to the right.
        above, right = math.cos(path) * up - math.sin(path) * level, math.cos(heading) * east - math.sin(heading) * north
        force = (thrust * math.cos(a) - drag) * moving / v + (lift * math.cos(bank) + thrust * math.sin(a)) * above
        spin = np.array([0.0, 0.0, self.spin])
        acceleration = (force + lift * math.sin(bank) * right) / m - g * up - 2 * cross(spin, moving)
        acceleration -= cross(spin, cross(spin, (self.radius + h) * up))
        r, east_rate, north_rate = self.radius + h, moving @ east, moving @ north
        lon_rate, lat_rate = east_rate / (r * math.cos(lat)), north_rate / r
        # The axes turn with the place: rates of the components of the velocity.
        turning = lon_rate * np.array([0.0, 0.0, 1.0]) - lat_rate * east
        upward, eastward, northward = (acceleration @ axis + moving @ cross(turning, axis) for axis in (up, east, north))
        ground = math.hypot(east_rate, north_rate)
        outward = (east_rate * eastward + north_rate * northward) / ground
        slopes = [(ground * upward - (moving @ up) * outward) / v**2, (eastward * north_rate - northward * east_rate) / ground**2]
        lags = self.gain * (u - x[7:]) if self.gain else []
        return np.array([moving @ up, lon_rate, lat_rate, acceleration @ moving / v, *slopes, -thrust / (self.impulse * g), *lags])

    def flown(self, trajectory) -> tuple[list[np.ndarray], np.ndarray, float]:
        """The states at the end of each phase, the largest part of each limit that is used, and the lowest altitude, by DOP853."""
        x, most, lowest, ends = trajectory["descent"].edge_states[0], np.zeros(3), np.inf, []
        for phase in trajectory.values():
            values, edges = phase.control.on_elements(np.linspace(-1, 1, 9)), phase.control.edges
            for left, right, rows in zip(edges, edges[1:], values, strict=False):
                fits = [np.polynomial.polynomial.Polynomial.fit(np.linspace(left, right, 9), column, 3) for column in rows.T]

                def law(t: float, fits=fits) -> np.ndarray:
                    return np.array([fit(t) for fit in fits])

                def slope(t: float, y: np.ndarray, law=law) -> np.ndarray:
                    return self.rates(y, law(t))

                found = solve_ivp(slope, (left, right), x, method="DOP853", rtol=1e-10, atol=1e-10, t_eval=np.linspace(left, right, 15))
                for t, y in zip(found.t, found.y.T, strict=True):
                    most = np.maximum(most, np.array(self.in_the_air(y, y[7] if self.gain else law(t)[0])[3]) / LIMITS)
                x, lowest = found.y[:, -1], min(lowest, found.y[0].min())
            ends.append(x)
        return ends, most, lowest


def bae(rho: float, v: float, a: float) -> float:
    """The constant of Betts, from (kg/m3)^0.5 (m/s)^3.07 to Btu/ft2/s; powers of degrees."""
    return 1.570305e-8 * math.sqrt(rho) * v**3.07 * np.polyval([-1.0117249e-6, 2.1286289e-4, -1.9213774e-2, 1.0672181], a / DEGREE)


def chai(rho: float, v: float, a: float) -> float:
    """Betts: 17700 sqrt(slug/ft3) (1e-4 ft/s)^3.07, of which 1 slug/ft3 is 515.3788 kg/m3; powers of radians."""
    return 17700 * math.sqrt(rho / 515.3788) * (1e-4 * v / 0.3048) ** 3.07 * np.polyval([-0.1903, 0.6988, -1.101, 1.067], a)


PAPERS = {
    "skip": Paper(6371203.92, 3.9856e14, 249.91, 1.2256, 7254.24, 319.0, 0.0, 0.0, bae),
    "smv": Paper(6378135.0, 3.986004418e14, 249.9092, 1.2255710, 7254.24, 300.0, 7.2921151e-5, 0.2, chai),
}
LOWEST = {"skip": 51880.0, "smv": 50e3}
GOALS = {
    "skip": [("terminal mass", "kg", "maximize"), ("terminal speed", "m/s", "maximize")],
    "smv": [
        ("flight time", "s", "minimize"),
        ("heat load", "kBtu/ft2", "minimize"),
        ("terminal speed", "m/s", "maximize"),
        ("terminal mass", "kg", "maximize"),
    ],
}


@pytest.mark.parametrize("case", PAPERS)
def test_the_rates_are_newtons_law(case):
    paper, rng = PAPERS[case], np.random.default_rng(1)
    lower = np.array([45e3, -2.0, -1.3, 2000.0, -0.5, -3.0, 5e3, -0.17, -1.4, 0.0])
    upper = np.array([80e3, 2.0, 1.3, 7800.0, 0.5, 3.0, 9e4, 0.52, 1.4, 2e6])
    n = 10 if paper.gain else 7
    for phase in load(case).compile().phases:
        assert [v.name for v in phase.states] == (STATES + CONTROLS)[:n]
        assert [v.name for v in phase.controls] == [f"{name} command" if paper.gain else name for name in CONTROLS]
        for _ in range(20):
            x, u = rng.uniform(lower[:n], upper[:n]), rng.uniform(lower[7:], upper[7:])
            found, limited = (np.array(function(x, u, 0.0, [0.0, 500.0])).ravel() for function in (phase.dynamics, phase.path))
            np.testing.assert_allclose(found, paper.rates(x, u), rtol=1e-5, atol=1e-11)
            np.testing.assert_allclose(limited, paper.in_the_air(x, x[7] if paper.gain else u[0])[3], rtol=1e-5)
            np.testing.assert_allclose(np.array(phase.integrands(x, u, 0.0, [0.0, 500.0])).ravel(), [limited[0]] if paper.gain else [])


@pytest.mark.parametrize("case", PAPERS)
def test_the_ends_the_limits_the_bounds_and_the_objectives(case):
    compiled, lowest = load(case).compile(), LOWEST[case]
    down, up = compiled.phases
    assert [(goal.name, goal.unit, goal.sense) for goal in compiled.goals] == GOALS[case]
    begin = [*START, 17.42 * DEGREE, -75 * DEGREE, 0.0][: len(down.states)]
    np.testing.assert_allclose(down.initial, [(value, value) for value in begin], rtol=1e-9)
    assert down.final[0] == (lowest, lowest) and down.final[4] == (0, 0) and up.final[0] == (79248.0, 79248.0)
    for phase in compiled.phases:
        assert [path.upper for path in phase.paths] == pytest.approx(LIMITS)
        bounds = {v.name.removesuffix(" command"): (v.lower, v.upper) for v in (*phase.states, *phase.controls)}
        for name, size in zip(CONTROLS, ((-10 * DEGREE, 30 * DEGREE), (-80 * DEGREE, 80 * DEGREE), (0, 2e6)), strict=True):
            assert bounds[name] == pytest.approx(size)
        assert bounds["altitude"] == (lowest, 79248.0) and bounds["speed"][1] == 7802.88 and bounds["mass"] == (3177.0, 90719.0)
    # 2269.7864 kW/m2 are 200 thermochemical Btu/ft2/s.
    assert pytest.approx(2269786.4, rel=1e-7) == 200 * 1054.350264488889 / 0.3048**2


@pytest.mark.parametrize("data", [{"lag_gain": 5.0}, {"impulse": 450.0}, {"lowest": 30e3}, {"mass": 5e4}, {"fastest": 9e3}])
def test_other_data_make_a_problem_with_a_guess_within_bounds(data):
    for phase in load("smv", **data).compile().phases:
        for v in (*phase.states, *phase.controls):
            values = phase.guesses[v.name][1]
            assert (values >= v.lower).all() and (values <= v.upper).all(), v.name


def test_the_thrust_of_the_skip_may_lag():
    lagged = load("skip", thrust_lag=0.2, impulse=300.0, lowest=55e3, mass=80e3).compile().phases[1]
    assert [v.name for v in lagged.states][-1] == "thrust" and [v.name for v in lagged.controls][-1] == "thrust command"
    assert lagged.states[0].lower == 55e3 and lagged.states[6].upper == 80e3


@pytest.fixture(scope="module")
def skips() -> Front:
    """Its ends and two points between."""
    problem = load("skip")
    return sweep(problem, stated(problem.default_transcription), points=4, method="epsilon", starts=1, verify=None)


@pytest.mark.slow
def test_the_ends_of_the_skips_front_fly(skips):
    """Limits within half a per cent, the end within a metre, never below the lowest altitude by more; as good as hours of search."""
    heaviest, *_, fastest = sorted(skips, key=lambda point: point.F[0])
    known = front_of("skip")
    assert heaviest.objectives["terminal mass"] > known[:, 0].max() - 20.0
    assert fastest.objectives["terminal speed"] > 7802.87 and fastest.objectives["terminal mass"] > known[:, 0].min() - 20.0
    for point in (heaviest, fastest):
        (_, end), most, lowest = PAPERS["skip"].flown(point.trajectory)
        assert most.max() < 1.005 and lowest > 51880 - 1.0 and end[0] == pytest.approx(79248, abs=1.0)
        assert [end[6], end[3]] == pytest.approx(list(point.objectives.values()), rel=1e-5)


@pytest.mark.slow
def test_rates_of_the_skips_front_agree_with_differences_of_other_optima(skips):
    """The greatest mass at speeds a little to both sides of each point's."""
    nlp = stated(load("skip").default_transcription).nlp(load("skip"))
    assert len(skips) == 4
    for point in skips[1:-1]:
        first, second = (
            scalarize(nlp, point.decision, reference=np.array([0.0, point.F[1] + shift]), weights=np.array([1.0, 0.0]))
            for shift in 0.002 * np.ptp(skips.F[:, 1]) * np.array([-1.0, 1.0])
        )
        assert first.status == second.status == "converged"
        mass, speed = second.F - first.F
        found = trade_offs(point)
        assert found.rate("terminal mass", "terminal speed") == pytest.approx(mass / speed, rel=0.02)
        assert found.matrix[1, 0] == pytest.approx(mass / speed, rel=0.02)
        assert not found.messages


@pytest.mark.slow
def test_a_skip_is_chosen_at_the_kink_of_the_largest_distance(skips):
    """There both distances are equal."""
    choice = decide(load("skip"), ReferencePoint({"terminal mass": 60000.0}), start=skips, starts=1)
    assert choice.message == "" and choice.point.verified and choice.point.optimality < 1e-6
    a, b = (1 - degree for degree in choice.degrees.values())
    assert a == pytest.approx(b, abs=1e-6) and np.isfinite(choice.value)


def reversals(phase) -> np.ndarray:
    """How often each command goes back by more than a tenth of its range within two elements, of those that chatter nearly every time."""
    first, last = phase.control.ends()
    steps = np.diff(np.vstack([first[:1], last]), axis=0) / [math.radians(40), math.radians(160), 2e6]
    return ((steps[1:] * steps[:-1] < 0) & (np.minimum(np.abs(steps[1:]), np.abs(steps[:-1])) > 0.1)).sum(axis=0)


SMV_MESH = stated(load("smv").default_transcription)


@pytest.fixture(scope="module")
def quickest() -> Point:
    return optimize(load("smv"), SMV_MESH, starts=1)


# A shorter flight, of 426 s, is found by `payoff` without a transcription, on finer meshes and in several times the work.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("goal", "limit"), [("flight time", 430.2), ("heat load", 45.7), ("terminal speed", -7785), ("terminal mass", -86350)], ids=str
)
def test_an_end_of_the_smv_is_a_flight(goal, limit, quickest):
    """Verified; flown again it ends within 20 m and keeps its limits, and commands do not chatter. It is no worse than what was found
    before on other meshes and from other starts, less what moving it inside its limits may cost."""
    begun = quickest.alone() if goal in ("heat load", "terminal speed") else None
    found = quickest if goal == "flight time" else optimize(load("smv"), SMV_MESH, objective=goal, start=begun, starts=1)
    point = found.alone().refine()[0]
    (low, end), most, _ = PAPERS["smv"].flown(point.trajectory)
    # With the rounding of some processors the heaviest flight ends at the limit of 500 iterations, is not moved, and says so.
    assert point.verified or (goal == "terminal mass" and point.status == "failed" and point.simulated_violation < 2e-3)
    assert abs(low[0] - 50e3) < 20 and abs(end[0] - 79248.0) < 20 and most.max() < 1.005
    assert all(reversals(phase).max() <= 0.2 * len(phase.control.edges) for phase in point.trajectory.values())
    assert point.F[list(point.objectives).index(goal)] < limit
