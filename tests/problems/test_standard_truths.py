"""Independent references of published problems: closed forms, the maximum principle by shooting, arcs of known controls by integration."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_bvp, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

from macs import optimize
from problems import Problem, load
from problems.cases.standard import published
from transcription import parse

TIGHT = {"rtol": 1e-11, "atol": 1e-13, "method": "DOP853"}


def value(name, i=0):
    return published(name)[i].value


def shot(residual, guess):
    """The root of a shooting function."""
    found, _, flag, words = fsolve(residual, guess, xtol=1e-12, full_output=True)
    assert np.abs(residual(found)).max() < 1e-8, (flag, words)
    return found


@pytest.mark.parametrize("wall", [1 / 9, 0.2])
def test_the_effort_below_a_ceiling(wall):
    i = 0 if wall < 1 / 6 else 1
    if wall < 1 / 6:  # u = -2/(3 wall) (1 - t/(3 wall)) until 3 wall, and the mirror image
        half, _ = quad(lambda t: 0.5 * (2 / (3 * wall) * (1 - t / (3 * wall))) ** 2, 0, 3 * wall)
    else:  # a cubic through the wall at the middle: x = t + a t^2 + b t^3 with x(1/2) = wall, v(1/2) = 0
        a, b = np.linalg.solve([[0.25, 0.125], [1.0, 0.75]], [wall - 0.5, -1.0])
        half, _ = quad(lambda t: 0.5 * (2 * a + 6 * b * t) ** 2, 0, 0.5)
    assert value("bryson_denham", i) == pytest.approx(2 * half, rel=1e-12)
    if wall < 1 / 6:
        assert value("breakwell") == pytest.approx(2 * half * wall / 0.1, rel=1e-12)


def test_the_cycloid():
    angle = brentq(lambda a: (a - np.sin(a)) - (1 - np.cos(a)), 1, 4, xtol=1e-14)
    assert value("brachistochrone") == pytest.approx(angle * np.sqrt(2 / (1 - np.cos(angle)) / 9.8), rel=1e-11)


def test_the_linear_tangent_law():
    def duration(a):  # tan u from sinh a to -sinh a; the horizontal speed fixes the time
        return 45 / 100 * np.sinh(a) / a

    def height(a):
        return 100 * duration(a) ** 2 * (np.sinh(a) * np.cosh(a) - a) / (2 * np.sinh(a)) ** 2

    assert value("linear_tangent") == pytest.approx(duration(brentq(lambda a: height(a) - 5, 0.01, 5, xtol=1e-15)), rel=1e-11)


def test_the_layers_of_zero_hamiltonian():
    def layer(x, sign):  # the integral of sqrt(x^6 + x^2) + sign x^3
        return quad(lambda s: np.sqrt(s**6 + s**2) + sign * s**3, 0, x, epsabs=1e-14)[0]

    for i, (start, end) in enumerate([(1.5, 1.0), (1.5, 1.0), (1.0, 1.5)]):
        assert value("hypersensitive", i) == pytest.approx(layer(start, -1) + layer(end, 1), rel=1e-11)
    # With a control of at most 5, the last layer ends on that bound; the Hamiltonian is zero there, too.
    bound = brentq(lambda s: s**3 + np.sqrt(s**6 + s**2) - 5, 0.5, 1.5, xtol=1e-15)
    on_it, _ = quad(lambda s: 0.5 * (s**2 + 25) / (5 - s**3), bound, 1.5, epsabs=1e-14)
    assert value("hypersensitive", 3) == pytest.approx(layer(1.0, -1) + layer(bound, 1) + on_it, rel=1e-11)


def test_newtons_nose():
    def radius(p, p_end):
        return 4 * p_end / (1 + p_end**2) ** 2 * (1 + p**2) ** 2 / (4 * p)

    def along(integrand, p_end):
        def rate(p):
            return 4 * p_end / (1 + p_end**2) ** 2 * (1 + p**2) * (3 * p**2 - 1) / (4 * p**2)

        return quad(lambda p: integrand(p) * rate(p), 1, p_end, epsabs=1e-14)[0]

    p_end = brentq(lambda p: along(lambda q: q, p) - 1, 1.01, 10, xtol=1e-14)
    drag = along(lambda p: 8 * radius(p, p_end) / (1 + p**2), p_end) + 4 * radius(1.0, p_end) ** 2
    assert value("newton_nose") == pytest.approx(drag, rel=1e-11)


def test_the_landing_with_one_switch():
    c, k = 2.349, 1.227 / 2.349

    def missed(z):
        fall, burn = z
        speed, height = -0.783 - fall, 1 - 0.783 * fall - 0.5 * fall**2
        left = 1 - k * burn
        speed_gained, height_gained = -c * np.log(left), c / k * (left * np.log(left) + k * burn)
        return [speed - burn + speed_gained, height + speed * burn - 0.5 * burn**2 + height_gained]

    assert value("moon_landing") == pytest.approx(1.227 * shot(missed, [0.3, 1.2])[1], rel=1e-11)


def test_the_catenary():
    def ends(shape):  # x = c cosh((s - a) / c) + b
        c, a, b = shape
        length = c * (np.sinh((1 - a) / c) + np.sinh(a / c))
        return [c * np.cosh(a / c) + b - 1, c * np.cosh((1 - a) / c) + b - 3, length - 4]

    c, a, b = shot(lambda shape: np.array(ends(shape)), [0.2, 0.4, 0.0])
    energy, _ = quad(lambda s: (c * np.cosh((s - a) / c) + b) * np.cosh((s - a) / c), 0, 1, epsabs=1e-13)
    assert value("hanging_chain") == pytest.approx(energy, rel=1e-10)


def test_the_double_integrator_that_becomes_singular():
    def x(t):
        return t - t**2 / 2

    switch = brentq(lambda t: 1 - t + x(t) * np.tanh(5 - t), 1, 2, xtol=1e-15)
    first, _ = quad(lambda t: x(t) ** 2 + (1 - t) ** 2, 0, switch, epsabs=1e-14)
    A = x(switch) / np.cosh(5 - switch)
    assert switch == pytest.approx(1.413764, abs=1e-6)
    assert value("jacobson") == pytest.approx(first + A**2 * np.sinh(2 * (5 - switch)) / 2, rel=1e-10)


def dubins_words(x: float, y: float, end: float) -> dict[str, float]:
    """Lengths of the words from (0, 0) in the direction 0 to (x, y) in the direction `end`; L and R are circles, S a straight line.

    Between the centres of the first and the last circle lies the straight line itself, turned by an angle where the sides differ, or the
    middle circle that touches both.
    """
    found = {}
    for one in (1, -1):
        for other in (1, -1):
            first, last = np.array([0.0, one]), np.array([x - other * np.sin(end), y + other * np.cos(end)])
            way = last - first
            distance, direction = np.linalg.norm(way), np.arctan2(way[1], way[0])
            if one == other:
                course, straight = direction, distance
            elif distance >= 2.0:
                course, straight = direction + one * np.arcsin(2.0 / distance), np.sqrt(distance**2 - 4)
            else:
                continue
            arcs = np.mod(one * course, 2 * np.pi) + np.mod(other * (end - course), 2 * np.pi)
            found["LR"[one < 0] + "S" + "LR"[other < 0]] = arcs + straight
        last = np.array([x - one * np.sin(end), y + one * np.cos(end)])
        way = last - np.array([0.0, one])
        distance, direction = np.linalg.norm(way), np.arctan2(way[1], way[0])
        for side in (1, -1):
            if distance <= 4.0:
                bend = side * np.arccos(distance / 4.0)
                middle = 2.0 * np.array([np.cos(direction + bend), np.sin(direction + bend)]) + np.array([0.0, one])
                out, back = np.arctan2(*(middle - np.array([0.0, one]))[::-1]), np.arctan2(*(last - middle)[::-1])
                # Headings where the circles touch: a quarter ahead of the direction between the centres, on either side.
                a, b = out + one * np.pi / 2, back - one * np.pi / 2
                length = np.mod(one * a, 2 * np.pi) + np.mod(-one * (b - a), 2 * np.pi) + np.mod(one * (end - b), 2 * np.pi)
                word = "LRL" if one > 0 else "RLR"
                found[word] = min(found.get(word, np.inf), length)
    return found


def test_the_shortest_word():
    lengths = dubins_words(-3.0, 1.0, 0.0)
    assert set(lengths) == {"LSL", "LSR", "RSL", "RSR", "LRL", "RLR"}
    assert value("dubins") == pytest.approx(min(lengths.values()), rel=1e-12)
    # Straight ahead, and half a circle.
    assert min(dubins_words(5.0, 0.0, 0.0).values()) == pytest.approx(5.0)
    assert min(dubins_words(0.0, 2.0, np.pi).values()) == pytest.approx(np.pi)


def test_the_fast_oscillator_with_one_switch():
    def moved(u, start, duration):
        return solve_ivp(lambda t, x: [x[1], -x[0] + x[1] * (1 - x[0] ** 2) + u], (0, duration), start, **TIGHT).y[:, -1]

    first, second = shot(lambda d: moved(-1, moved(1, (-0.4, 0.6), d[0]), d[1]) - (0.6, 0.4), [0.3, 1.0])
    assert first == pytest.approx(0.158320, abs=1e-6)
    assert value("fast_oscillator") == pytest.approx(first + second, rel=1e-10)


def test_the_cooling_of_the_stirred_tank():
    def cooling(x, a):
        return a * (x + 0.25) / 0.2

    def rates(t, state):
        x, y, a, b = state
        slope = np.exp(25 * x / (x + 2))
        reaction, steep = (y + 0.5) * slope, (y + 0.5) * slope * 50 / (x + 2) ** 2
        u = cooling(x, a)
        forward = -(2 + u) * (x + 0.25) + reaction, 0.5 - y - reaction
        return np.array([*forward, -(2 * x - a * (2 + u) + (a - b) * steep), -(2 * y + (a - b) * slope - b)])

    def ends(first, last):
        return np.array([first[0] - 0.09, first[1] - 0.09, last[2], last[3]])

    found = solve_bvp(rates, ends, np.linspace(0, 0.78, 100), np.full((4, 100), 0.05), tol=1e-9, max_nodes=20000)
    assert found.status == 0

    def cost(t):
        x, y, a, _ = found.sol(t)
        return x**2 + y**2 + 0.1 * cooling(x, a) ** 2

    assert value("stirred_tank") == pytest.approx(quad(cost, 0, 0.78, epsabs=1e-12, limit=200)[0], rel=1e-8)


def test_zermelos_heading():
    def end(z):
        def rates(_, s):
            return [np.cos(s[2]) - s[1], np.sin(s[2]), np.cos(s[2]) ** 2]

        return solve_ivp(rates, (0, z[1]), [3.66, -1.86, z[0]], **TIGHT).y[:2, -1]

    assert value("zermelo") == pytest.approx(shot(end, [1.8, 5.5])[1], rel=1e-10)


def test_the_longest_range():
    def back(z):  # from the end, where the costate of the speed is nothing
        def rates(_, s):
            _, _, v, weight = s
            along, up = v, z[1] * v - weight
            size = np.hypot(along, up)
            return [v * along / size, v * up / size, 0.5 - up / size, -(along + z[1] * up) / size]

        return solve_ivp(rates, (2, 1e-9), [0, 0.1, z[0], 0], **TIGHT).y[:, -1]

    z = shot(lambda z: back(z)[1:3], [0.9, 0.5])
    assert value("bryson_max_range") == pytest.approx(-back(z)[0], abs=5e-8)


def test_the_largest_orbit():
    def end(w):
        def rates(t, s):
            r, u, v, lr, lu, lv = s
            a = 0.1405 / (1 - 0.0749 * t) / np.hypot(lu, lv)
            lr_rate = lu * (v**2 / r**2 - 2 / r**3) - lv * u * v / r**2
            return [u, v**2 / r - 1 / r**2 + a * lu, -u * v / r + a * lv, lr_rate, -lr + lv * v / r, (-2 * lu * v + lv * u) / r]

        return solve_ivp(rates, (0, 3.32), [1, 0, 1, *w], **TIGHT).y[:, -1]

    def missed(w):
        r, u, v, lr, _, lv = end(w)
        return [u, v - r**-0.5, lr - 1 - 0.5 * lv * r**-1.5]

    assert value("orbit_raising") == pytest.approx(end(shot(missed, [2.0, 1.0, 2.0]))[0], rel=1e-9)


@pytest.mark.slow
def test_the_oscillator_with_a_limited_control():
    def end(w):
        def rates(_, s):
            x, y, _, lx, ly = s
            u = np.clip(-lx / 2, -0.3, 1)
            return [(1 - y**2) * x - y + u, x, x**2 + y**2 + u**2, -2 * x - lx * (1 - y**2) - ly, -2 * y + lx * (2 * x * y + 1)]

        return solve_ivp(rates, (0, 5), [0, 1, 0, *w], max_step=0.02, **TIGHT).y[:, -1]

    assert value("van_der_pol") == pytest.approx(end(shot(lambda w: end(w)[3:], [0.8, 4.8]))[2], rel=1e-8)


@pytest.mark.slow
def test_the_best_temperatures():
    coldest, hottest = np.exp(-2500 / 298), np.exp(-2500 / 398)

    def end(w):
        def rates(_, s):
            a, b, la, lb = s
            gain, loss = (lb - la) * 4000 * a**2, lb * 620000 * b
            z = np.clip(gain / (2 * loss), coldest, hottest) if loss > 1e-300 else hottest
            made, lost = 4000 * z * a**2, 620000 * z**2
            return [-made, made - lost * b, -(lb - la) * 8000 * z * a, lb * lost]

        return solve_ivp(rates, (0, 1), [1, 0, *w], max_step=0.01, **TIGHT).y[:, -1]

    w = shot(lambda w: end(w)[2:] - [0, 1], [0.78, 0.79])
    assert value("batch_reactor") == pytest.approx(end(w)[1], abs=2e-9)


def flown(name, arcs, durations):
    """The final state after arcs of constant controls, by the dynamics of the case."""
    phase = load(f"standard/{name}").compile().phases[0]
    x = np.array([first for first, _ in phase.initial])
    for u, duration in zip(arcs, durations, strict=True):
        x = solve_ivp(lambda t, x, u=u: np.array(phase.dynamics(x, u, t, [0, 1])).ravel(), (0, duration), x, **TIGHT).y[:, -1]
    return x, np.array([last for last, _ in phase.final])


ARCS = {
    "two_link_arm": ([(1, 1), (1, -1), (-1, -1), (-1, 1)], [0.943, 0.548, 1.136, 0.355]),
    "robot_arm": ([(-1, 1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1), (1, -1, -1), (-1, -1, -1)], [2.285, 0.511, 1.774, 1.774, 0.511, 2.285]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ARCS)
def test_as_many_arcs_as_conditions(name):
    """Bang-bang extremals with as many arcs as final conditions: their lengths are the roots of these."""
    arcs, guess = ARCS[name]

    def missed(durations):
        x, goal = flown(name, arcs, durations)
        return x - goal

    assert value(name) == pytest.approx(shot(missed, guess).sum(), abs=1e-8)


@pytest.mark.parametrize(
    ("name", "arcs", "durations"),
    [
        ("f8", [(0.05236,), (-0.05236,), (0.05236,), (-0.05236,)], [1.13483594, 0.34661025, 1.60803483, 0.69137476]),
        ("car", [(1.0,), (-2.0,)], [20.0, 10.0]),
    ],
)
def test_these_arcs_end_where_they_should_in_that_time(name, arcs, durations):
    x, goal = flown(name, arcs, durations)
    assert x == pytest.approx(goal, abs=1e-6)
    assert value(name) == pytest.approx(sum(durations), abs=1e-7)


# Arcs with a smooth control each: phases of their own


def arcs(name, states, rates, controls, times, integrand=None):
    """A problem with a phase for each arc; a control of None is free. Returns it, the last phase and the integral."""
    problem, previous, total = Problem(name), None, 0
    for i, control in enumerate(controls):
        phase = problem.phase(f"arc {i}", t0=times[i], tf=times[i + 1])
        ends = {key: (None if previous else first, last if i == len(controls) - 1 else None) for key, (_, first, last) in states.items()}
        x = [phase.state(key, bounds=states[key][0], initial=first, final=last) for key, (first, last) in ends.items()]
        u = phase.control("u", bounds=(0, 3.5 if name == "rocket" else 1)) if control is None else control
        phase.dynamics(**dict(zip(states, rates(*x, u), strict=True)))
        total = total if integrand is None else total + phase.integral(integrand(*x))
        if previous is not None:
            problem.link(previous, phase)
        previous = phase
    return problem, previous, total


def solved(problem, mesh="dfet:20x5"):
    point = optimize(problem, parse(mesh), tolerance=1e-9, verify=None, starts=1)
    assert point.status == "converged"
    return next(iter(point.simulate().objectives.values()))


@pytest.mark.slow
def test_the_rocket_with_three_arcs():
    import casadi as ca

    def rates(h, v, m, u):
        return v, (u - 310 * v**2 * ca.exp(-500 * (h - 1))) / m - 1 / h**2, -2 * u

    states = {"h": ((1, 2), 1.0, None), "v": ((0, 2), 0.0, None), "m": ((0.6, 1), 1.0, 0.6)}
    problem, last, _ = arcs("rocket", states, rates, [3.5, None, 0.0], [0.0, (0.001, 0.1), (0.02, 0.15), (0.1, 0.5)])
    problem.maximize("height", last.final(last["h"]))
    assert solved(problem, "dfet:12x4") == pytest.approx(value("rocket"), abs=5e-8)
    assert value("rocket") == pytest.approx(1.01283, abs=1e-5), "as published"


@pytest.mark.slow
def test_the_blend_with_three_arcs():
    def rates(x, y, u):
        return u * (10 * y - x), u * (x - 10 * y) - (1 - u) * y

    states = {"x": ((0, 1.1), 1.0, None), "y": ((0, 1), 0.0, None)}
    problem, last, _ = arcs("blend", states, rates, [1.0, None, 0.0], [0.0, (0.05, 0.4), (0.5, 0.99), 1.0])
    problem.maximize("yield", 1 - last.final(last["x"]) - last.final(last["y"]))
    assert solved(problem) == pytest.approx(value("catalyst_mixing"), abs=5e-8)
    assert value("catalyst_mixing") == pytest.approx(0.0480556, abs=2e-7), "as published"


@pytest.mark.slow
def test_fishing_with_three_arcs():
    def rates(x, y, u):
        return x - x * y - 0.4 * x * u, -y + x * y - 0.2 * y * u

    states = {"prey": ((0, 20), 0.5, None), "predators": ((0, 20), 0.7, None)}
    times = [0.0, (2.0, 3.0), (3.5, 5.0), 12.0]
    problem, _, total = arcs("fishing", states, rates, [0.0, 1.0, None], times, lambda x, y: (x - 1) ** 2 + (y - 1) ** 2)
    problem.minimize("deviation", total)
    assert solved(problem) == pytest.approx(value("lotka_fishing"), abs=5e-6)
    assert value("lotka_fishing") == pytest.approx(1.34408, abs=5e-6), "as published"


@pytest.mark.slow
def test_a_flight_of_less_fuel_than_the_published_one():
    """Nine arcs of the free-flying robot, and the nine symmetric ones of the literature, whose fuel is that of Betts.

    The former are not quite the optimum, whose sixth arc is singular.
    """
    assert value("free_flying_robot") < 7.688928196 and published("free_flying_robot")[0].met(7.688928196)
    right = {1: (1, 0), 0: (0, 0), -1: (0, 1)}
    flights = {
        7.688928196: (
            [(1, 1), (1, 0), (0, 0), (-1, 0), (0, 0), (0, 1), (0, 0), (0, -1), (1, -1)],
            [0.5249, 1.3652, 1.1554, 3.0168, 0.1705, 0.3028, 3.6994, 1.5755, 0.1894],
        ),
        published("free_flying_robot")[0].local[0]: (
            [(-1, 1), (0, 1), (0, 0), (1, 0), (0, 0), (-1, 0), (0, 0), (0, -1), (1, -1)],
            [0.6103, 0.4410, 1.4896, 2.2935, 2.3313, 2.2935, 1.4896, 0.4410, 0.6103],
        ),
    }
    for fuel, (pairs, durations) in flights.items():
        jets = [(*right[a], *right[b]) for a, b in pairs]

        def missed(d, jets=jets):
            x, goal = flown("free_flying_robot", jets, d)
            return np.append(x - goal, sum(d) - 12)

        # The lengths are known to four digits: the nearest ones that end where they should cost the same to the second order.
        durations = np.array(durations)
        for _ in range(3):
            slopes = np.column_stack([(missed(durations + 1e-6 * e) - missed(durations)) / 1e-6 for e in np.eye(9)])
            durations = durations - np.linalg.pinv(slopes) @ missed(durations)
        assert np.abs(missed(durations)).max() < 1e-8 and (durations > 0).all()
        assert durations @ np.abs(pairs).sum(axis=1) == pytest.approx(fuel, abs=1e-7)


def test_springs_take_the_effort_of_the_gramian():
    """Least effort to bring a linear system from a state to rest: y' W^-1 y, with the state y that it would reach by itself."""
    for record in published("springs"):
        n = record.data.get("masses", 2)
        chain = -2 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)
        chain[-1, -1] = -1
        A = np.block([[np.zeros((n, n)), np.eye(n)], [chain, np.zeros((n, n))]])
        push = np.eye(2 * n)[-1]
        # W = integral of exp(A t) b b' exp(A' t), from the exponential of one matrix (Van Loan 1978).
        whole = expm(np.block([[-A, np.outer(push, push)], [np.zeros_like(A), A.T]]) * 40.0)
        transition = whole[2 * n :, 2 * n :].T
        W, y = transition @ whole[: 2 * n, 2 * n :], transition[:, 0]
        assert y @ np.linalg.solve(W, y) == pytest.approx(record.value, rel=1e-6)


def test_a_mountain_car_switches_twice():
    def time(first: float, second: float) -> float:
        y, passed = np.array([-0.5, 0.0]), 0.0
        goal = lambda t, y: y[0] - 0.5  # noqa: E731
        goal.terminal = True
        for u, duration in ((1, first), (-1, second), (1, 300.0)):
            arc = solve_ivp(lambda t, y, u=u: [y[1], 0.001 * u - 0.0025 * np.cos(3 * y[0])], (0, duration), y, events=goal, **TIGHT)
            y, passed = arc.y[:, -1], passed + arc.t[-1]
        return passed

    best = 14.64628942, 37.80285988
    assert time(*best) == pytest.approx(published("mountain_car")[0].value, abs=1e-7)
    assert all(time(best[0] + a, best[1] + b) > time(*best) for a, b in ((0.1, 0), (-0.1, 0), (0, 0.1), (0, -0.1)))
