"""Collocation at Gauss, Radau, Lobatto and Chebyshev points: coefficients, orders, equivalences, what a user states and gets."""

import runpy
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from cases import candidates, integrator
from numpy.polynomial import Polynomial, legendre
from scipy.integrate import solve_ivp

from macs import Front, optimize, payoff
from problems import Problem, load
from problems.cases.standard import published
from transcription import Collocation
from transcription.elements.tables import POINTS, collocation_tables, control_degree
from transcription.nlp.optimality import Conditions, costates
from transcription.nlp.scalarized import scalarize
from transcription.numerics.polynomials import nodes


def tables(points: str, degree: int):
    return collocation_tables(points, degree, control_degree(points, degree), False)


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 8, 40, 60])
def test_points_are_roots_and_weights_the_closed_forms(degree):
    n = degree + 1
    of = {points: tables(points, degree) for points in POINTS}
    last, lower = legendre.Legendre.basis(degree), legendre.Legendre.basis(degree - 1)
    gauss, radau, lobatto, chebyshev = (of[points] for points in ("gauss", "radau", "lobatto", "chebyshev"))
    assert last(gauss.tau) == pytest.approx(np.zeros(degree), abs=1e-13)
    assert gauss.weights == pytest.approx(2 / ((1 - gauss.tau**2) * last.deriv()(gauss.tau) ** 2), rel=1e-10)
    assert radau.tau[0] == -1.0 and (last + lower)(radau.tau) == pytest.approx(np.zeros(degree), abs=1e-13)
    assert radau.weights[1:] == pytest.approx(((1 - radau.tau) / (degree * lower(radau.tau)) ** 2)[1:], rel=1e-10)
    assert radau.weights[0] == pytest.approx(2 / degree**2, rel=1e-11)
    assert (lobatto.tau[0], lobatto.tau[-1]) == (-1.0, 1.0) and len(lobatto.tau) == n
    assert last.deriv()(lobatto.tau[1:-1]) == pytest.approx(np.zeros(n - 2), abs=1e-13 * degree**3)
    assert lobatto.weights == pytest.approx(2 / (degree * n * last(lobatto.tau) ** 2), rel=1e-10)
    assert chebyshev.tau == pytest.approx(-np.cos(np.pi * np.arange(n) / degree), abs=1e-15)
    # Clenshaw and Curtis as Trefethen writes it, "Is Gauss quadrature better than Clenshaw-Curtis?", SIAM Review 50(1), 2008.
    k = np.arange(n)
    terms = [2 / (1 - 4 * j**2) * (0.5 if 2 * j == degree else 1.0) * np.cos(2 * j * np.pi * k / degree) for j in range(1, degree // 2 + 1)]
    curtis = (np.where((k == 0) | (k == degree), 1.0, 2.0) / degree) * (1 + sum(terms, np.zeros(n)))
    assert chebyshev.weights == pytest.approx(curtis, rel=1e-10)


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("points", POINTS)
def test_quadratures_are_as_exact_as_they_should_be_and_no_more(points, degree):
    table = tables(points, degree)
    highest = {"gauss": 2 * degree - 1, "radau": 2 * degree - 2, "lobatto": 2 * degree - 1, "chebyshev": degree + 1 - degree % 2}[points]
    for power in range(highest + 2):
        exact = (1 - (-1) ** (power + 1)) / (power + 1)
        error = abs(table.weights @ table.tau**power - exact)
        assert error < 1e-14 if power <= highest else power % 2 or error > 1e-8


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("degree", [1, 2, 4, 7, 40, 60])
def test_the_runge_kutta_method_integrates_rates_that_are_polynomials(points, degree):
    """x(c_i) = x_0 + h sum a_ij f_j, for every rate of the degree of the polynomial through the points."""
    table = tables(points, degree)
    rates = legendre.Legendre(np.random.default_rng(degree).uniform(-1, 1, len(table.tau)))
    states = rates.integ(lbnd=-1)
    assert 2 * rates(table.tau) @ table.implicit == pytest.approx(states(table.tau), abs=1e-13)
    assert 2 * rates(table.tau) @ table.recover == pytest.approx(states(table.nodes), abs=1e-13)
    assert table.weights @ rates(table.tau) == pytest.approx(states(1.0), abs=1e-13)


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("degree", [1, 2, 4, 7, 20, 40, 60])
def test_the_equations_hold_for_what_the_method_gives_and_determine_it(points, degree):
    table = tables(points, degree)
    rng = np.random.default_rng(0)
    left, rates = rng.normal(), rng.normal(size=len(table.tau))
    X, right = left + 2 * rates @ table.recover, left + table.weights @ rates
    assert np.array([left, *X, right]) @ table.balance + rates @ table.test == pytest.approx(np.zeros(table.rows), abs=1e-11)
    assert np.array_equal(table.balance[-1], -np.eye(1, table.rows, table.rows - 1)[0]), "the right end is in the last row alone"
    # What an equation misses, states miss no more than some times as much.
    assert np.abs(np.linalg.inv(table.balance[1:])).sum(axis=0).max() < 4 * degree


def differential(points: str, degree: int) -> np.ndarray:
    """D of the literature: derivatives at the points of the polynomial through these and the left end, for Radau also the right one."""
    tau = tables(points, degree).tau
    places = np.append(tau, 1.0) if points == "radau" else np.append(-1.0, tau)
    slopes = np.array([legendre.Legendre.basis(k).deriv()(tau) for k in range(len(places))]).T
    return slopes @ np.linalg.inv(legendre.legvander(places, len(places) - 1))


@pytest.mark.parametrize("points", ["gauss", "radau"])
@pytest.mark.parametrize("degree", [1, 2, 3, 6, 10])
def test_it_is_the_differential_form_of_the_literature_with_its_covector_mapping(points, degree):
    """D X = h/2 f, and for Gauss the quadrature to the end: Benson et al. 2006, Garg et al. 2011. Both forms of the equations have the same
    weighted sum with any multipliers, if costates are these over the weights (and for Gauss that of the end more)."""
    table, D, rng = tables(points, degree), differential(points, degree), np.random.default_rng(1)
    left, right, X, rates = rng.normal(), rng.normal(), rng.normal(size=table.coefficients), rng.normal(size=len(table.tau))
    multipliers = rng.normal(size=table.rows)
    told = nodes(table.costate_basis, len(table.costates) - 1)
    costates = dict(zip(np.round(told, 12), table.costates @ multipliers, strict=True))
    at_points = np.array([costates[round(tau, 12)] for tau in table.tau])
    ours = multipliers @ (np.array([left, *X, right]) @ table.balance + rates @ table.test)
    if points == "radau":
        theirs = (table.weights * at_points) @ (rates - D @ np.array([left, *X, right]))
        at_end = (table.weights * at_points) @ D[:, -1]
    else:
        at_end = costates[1.0]
        mapped = table.weights * (at_points - at_end)
        theirs = mapped @ (rates - D @ np.array([left, *X])) + at_end * (left + table.weights @ rates - right)
        assert costates[-1.0] == pytest.approx(at_end - D[:, 0] @ mapped, abs=1e-9), "that of the beginning"
    assert ours == pytest.approx(theirs, abs=1e-10)
    assert costates[1.0] == pytest.approx(at_end, abs=1e-10)


ORDERS = [
    *(("gauss", degree, 2 * degree) for degree in (1, 2, 3)),
    *(("radau", degree, 2 * degree - 1) for degree in (1, 2, 3, 4)),
    *(("lobatto", degree, 2 * degree) for degree in (1, 2, 3)),
    *(("chebyshev", degree, degree + 1 + (degree + 1) % 2) for degree in (1, 2, 3, 4)),
]


@pytest.mark.parametrize(("points", "degree", "order"), ORDERS)
def test_ends_of_intervals_converge_with_the_order_of_the_method(points, degree, order):
    """x' = y, y' = -x - y/2 + cos 3t by propagation, against an integrator of high order."""
    problem = Problem("driven")
    phase = problem.phase("run", t0=0, tf=4)
    x, y = phase.state("x", bounds=(-3, 3), initial=1.0), phase.state("y", bounds=(-3, 3), initial=0.0)
    scale = phase.control("u", bounds=(0, 2))
    phase.dynamics(x=y, y=-x - 0.5 * y + scale * ca.cos(3 * phase.time))
    problem.minimize("end", phase.final(x))
    rates = lambda t, x: [x[1], -x[0] - 0.5 * x[1] + np.cos(3 * t)]  # noqa: E731
    exact = solve_ivp(rates, (0, 4), [1.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    errors = []
    for intervals in (12, 24) if degree > 1 else (128, 256):
        nlp = Collocation(intervals, degree, points=points).transcribe(problem)
        z = nlp.propagate(nlp.first_guess(np.ones((1, len(nlp.free)))))
        assert nlp.evaluate(z)[1] < 1e-12
        errors.append(np.linalg.norm(nlp.unpack(z[0])["run"].edge_states[-1] - exact))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


def rise() -> Problem:
    """y' = 5/2 (y u - y - u^2), y(0) = 1, largest y(2): y = 4 / (1 + 3 exp(5 t/2)), u = y/2 (Garg et al., "A unified framework for the
    numerical solution of optimal control problems using pseudospectral methods", Automatica 46, 2010, example 1)."""
    problem = Problem("rise")
    run = problem.phase("run", t0=0, tf=2)
    y = run.state("y", bounds=(-0.5, 2), initial=1)
    u = run.control("u", bounds=(-0.5, 1))
    run.dynamics(y=2.5 * (y * u - y - u**2))
    problem.maximize("end", run.final(y))
    return problem


def exact_rise(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State, control and costate (of what is minimised, -y(2)) in closed form."""
    y, grown = 4 / (1 + 3 * np.exp(2.5 * t)), lambda t: np.exp(2 * np.log(1 + 3 * np.exp(2.5 * t)) - 2.5 * t)
    return y, 0.5 * y, -grown(t) / grown(2.0)


def risen(method: Collocation):
    """The NLP of `rise`, and its optimum."""
    nlp = method.nlp(rise().compile())
    solved = scalarize(nlp, nlp.first_guess(np.full((1, len(nlp.free)), 0.3))[0], reference=np.zeros(1), weights=np.ones(1))
    assert solved.status == "converged"
    return nlp, solved


@pytest.mark.parametrize("points", POINTS)
def test_global_collocation_converges_exponentially(points):
    errors = []
    for degree in (4, 8, 12, 16, 28, 40):
        nlp, solved = risen(Collocation(1, degree, points=points))
        flown = nlp.unpack(solved.z)["run"]
        y, u, _ = exact_rise(flown.time)
        # Where a control is no variable, it is extrapolated, and converges as well, a little later.
        errors.append([abs(solved.F[0] + exact_rise(2.0)[0]), np.abs(flown["y"] - y).max(), np.abs(flown["u"] - u).max()])
    of_objective, of_state, of_control = np.array(errors).T
    assert of_objective[2] < 2e-9 and of_state[3] < 5e-9 and of_control[3] < 1e-6
    assert (np.log10(of_state[:3] / of_state[1:4]) > 1.5).all(), "four degrees more give a digit and a half at least, every time"
    # From here on it is the accuracy of the solver.
    assert of_objective[3:].max() < 1e-10 and of_state[3:].max() < (3e-9 if points == "chebyshev" else 1e-9)


def regulated(method: Collocation) -> tuple[float, float]:
    """x' = u from 1, least integral of (x^2 + u^2) / 2 over 4 seconds: errors of the optimum, tanh(4) / 2, and of u at the nodes of the
    trajectory, -sinh(4 - t) / cosh(4)."""
    problem = Problem("regulator")
    run = problem.phase("run", t0=0, tf=4)
    x, u = run.state("x", bounds=(-2, 2), initial=1), run.control("u", bounds=(-2, 2))
    run.dynamics(x=u)
    problem.minimize("cost", run.integral(0.5 * (x**2 + u**2)))
    nlp = method.nlp(problem.compile())
    solved = scalarize(nlp, np.zeros(len(nlp.variables)), reference=np.zeros(1), weights=np.ones(1))
    flown = nlp.unpack(solved.z)["run"]
    assert solved.status == "converged"
    return abs(solved.F[0] - 0.5 * np.tanh(4)), np.abs(flown["u"] + np.sinh(4 - flown.time) / np.cosh(4)).max()


@pytest.mark.parametrize(
    "methods",
    [
        *([Collocation(1, n, points=points) for n in (4, 6, 8, 10)] for points in ("gauss", "radau", "lobatto")),
        [Collocation(1, 2 * n, points="chebyshev", control_order=n) for n in (4, 6, 8, 10)],
    ],
    ids=["gauss", "radau", "lobatto", "chebyshev, half"],
)
def test_an_integral_cost_converges_exponentially(methods):
    of_optimum, of_control = np.array([regulated(method) for method in methods]).T
    assert (of_optimum[:-1] / of_optimum[1:] > 50).all() and of_optimum[-1] < 1e-11
    assert (of_control[:-1] / of_control[1:] > 10).all() and of_control[-1] < 1e-5


@pytest.mark.parametrize("method", [Collocation(1, 24), Collocation(6, 5, points="gauss")])
def test_costates_of_a_nonlinear_problem_are_those_of_the_closed_form(method):
    nlp, solved = risen(method)
    found = costates(nlp, solved.z, Conditions.of(nlp, solved.z).multipliers())["run"].polynomial
    times, (begins, ends) = np.linspace(0, 2, 41), found.ends()
    assert found(times)[:, 0] == pytest.approx(exact_rise(times)[2], abs=1e-5)
    assert begins[0, 0] == pytest.approx(exact_rise(0.0)[2], abs=1e-6)
    assert ends[-1, 0] == pytest.approx(-1.0, abs=1e-9), "the transversality condition, exactly"
    assert len(found.edges) == method.intervals + 1


@pytest.mark.parametrize("points", ["gauss", "lobatto"])
def test_bernstein_controls_stay_within_their_bounds_everywhere(points):
    problem = load("goddard")
    method = Collocation(4, 5, points=points, control="bernstein")
    point = optimize(problem, method, objective="flight time", verify=None, starts=1)
    values = point.trajectory["ascent"].control(np.linspace(0, point.objectives["flight time"], 500))
    assert np.abs(values).max() <= np.pi / 2 + 1e-9
    free = optimize(problem, Collocation(4, 5, points=points), objective="flight time", verify=None, starts=1)
    assert np.abs(free.trajectory["ascent"].control(np.linspace(0, 109, 500))).max() > np.pi / 2 + 1e-3, "else this shows nothing"


@pytest.mark.parametrize("points", ["radau", "chebyshev"])
def test_peaks_absolute_values_and_periodic_controls(points):
    """From 0 to 1 in two seconds: the least peak of u^2 is 1/4 with the least way 1; a heading is turned no further than it must."""
    method, (problem, run) = Collocation(3, 4, points=points), integrator(final=1)
    problem.minimize("peak", run.peak(run["u"] ** 2))
    problem.minimize("way", run.integral(ca.fabs(run["u"])))
    front = payoff(problem, method, verify=1e-5, starts=1)
    assert front.verified.all() and front.objectives[0] == pytest.approx([0.25, 1.0], abs=1e-6)
    assert front.objectives[1, 1] == pytest.approx(1.0, abs=1e-6)
    problem, run = integrator(bounds=(-np.pi, np.pi), period=2 * np.pi)
    run._rates = {}
    run.dynamics(x=ca.cos(run["u"]))
    problem.maximize("end", run.final(run["x"]))
    nlp = method.transcribe(problem)
    Z = nlp.propagate(nlp.first_guess(candidates(nlp, 3)))
    moved = Z.copy()
    moved[:, nlp.free] += 2 * np.pi * np.random.default_rng(0).integers(-1, 2, (3, len(nlp.free)))
    assert nlp.residuals(moved)[0] == pytest.approx(nlp.residuals(Z)[0], abs=1e-12)
    assert np.abs(np.array(nlp.functions(moved.T)[1])).max() < 1e-10, "the dynamics hold a period on as well"


def test_dynamics_without_derivatives_are_refused():
    class Rate(ca.Callback):
        def __init__(self):
            ca.Callback.__init__(self)
            self.construct("rate", {})

        def eval(self, arguments):
            return [-arguments[0]]

    rate = Rate()
    problem = Problem("callback")
    phase = problem.phase("fall", t0=0, tf=1)
    x = phase.state("x", bounds=(-2, 2), initial=1)
    phase.dynamics(x=rate(x))
    problem.minimize("end", phase.final(x))
    with pytest.raises(ValueError, match="Collocation: phase 'fall': the dynamics have no derivatives"):
        Collocation(2, 3).transcribe(problem)


@pytest.mark.slow
@pytest.mark.parametrize("points", ["radau", "lobatto"])
def test_meshes_are_refined_until_a_simulation_agrees(points):
    coarse = optimize(load("standard/van_der_pol"), Collocation(8, 4, points=points), verify=None, starts=1)
    assert coarse.simulate().violation > 1e-4
    refined = coarse.alone().refine_mesh(tolerance=1e-6)[0]
    check = refined.simulate()
    assert check.max_defect < 1e-6 and check.violation < 1e-6 and refined.note == ""
    assert refined.objectives["cost"] == pytest.approx(2.8672610452, rel=1e-6), "by the maximum principle"


def test_interpolation_of_polynomials_is_exact():
    p = Polynomial([0.3, -0.2, 0.2])
    for points in POINTS:
        problem, run = integrator()
        problem.minimize("end", run.final(run["x"]))
        nlp = Collocation(3, 4, points=points).nlp(problem.compile())
        z = nlp.propagate(nlp.first_guess(np.zeros((1, len(nlp.free)))))[0]
        slots, places = nlp.profiles[0].columns, nlp.profiles[0].places
        z[nlp.free[slots]] = p(2 * places)
        z = nlp.propagate(z[None])[0]
        flown = nlp.unpack(z)["run"]
        t = np.linspace(0, 2, 17)
        assert flown.at(t)["u"] == pytest.approx(p(t), abs=1e-13)
        assert flown.at(t)["x"] == pytest.approx(p.integ()(t), abs=1e-13)
        assert nlp.interpolate(nlp.unpack(z)) == pytest.approx(z, abs=1e-12)


RADAU = {
    "delta_iii": (7529.7123, 0.01, "GPOPS (Rao et al., ACM TOMS 37(2), 2010): 7529.712412 kg; YAPSS, Legendre-Gauss-Radau: 7529.712287"),
    "tumour": (7571.67158, 0.02, "CGPOPS (Agamawi and Rao, ACM TOMS 46(3), 2020), by Radau collocation: 7571.67158"),
    "dynamic_soaring": (0.06358656, 1e-6, "YAPSS 0.2.3, with the data of GPOPS-II (Patterson and Rao, ACM TOMS 41(1), 2014)"),
    "hypersensitive": (1.330806904943, 1e-6, "closed form; the first example of GPOPS-II (Patterson and Rao 2014), which draws it"),
}
"""Optima of programs that collocate at Radau points, how near ours have to be, and where they are printed."""


@pytest.mark.slow
@pytest.mark.parametrize("name", RADAU)
def test_radau_reproduces_published_optima_of_radau_collocation(name):
    value, within, _ = RADAU[name]
    record = published(name)[0]
    mesh = Collocation(5, 5) if name == "delta_iii" else Collocation(20, 4)
    found = Front.of(optimize(load(f"standard/{name}"), mesh, verify=None, starts=1).alone())
    (point,) = found.refine_mesh(tolerance=1e-6).verify(1e-3)
    assert point.verified and point.objectives[record.objective] == pytest.approx(value, abs=within)
    assert record.met(point.objectives[record.objective])


PAGE = Path(__file__).parents[2] / "docs" / "convergence.py"


@pytest.mark.slow
def test_the_page_of_convergence_shows_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page: dict[str, Any] = runpy.run_path(str(PAGE))
    page["main"].__globals__["TARGET"] = tmp_path / "convergence.png"
    page["main"]()
    assert (tmp_path / "convergence.png").stat().st_size > 10_000 and "convergence.png" in capsys.readouterr().out
    for points in ("gauss", "radau", "lobatto"):
        found = {n: page["errors"](method)[0] for n, method in page["families"]()[points] if n <= 10}
        # Of a power of n, it would be the seventh or more.
        assert found[10] < 1e-9 and found[4] > 1e-6, points
