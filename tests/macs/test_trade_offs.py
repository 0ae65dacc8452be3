"""Trade-offs at points: against fronts and matrices in closed form, differences of other optima, and points moved off the front by hand."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import null_space
from smooth_problems import nlp_of, shuttle, slide, still, two_wells, vector
from synthetic_fronts import black_box

from macs import Front, optimize, sweep
from macs.decisions import Ranges, WeightedSum, decide, front_rates, plot_rates, trade_offs
from macs.decisions.trade_offs import TradeOffs, rates
from macs.fronts.builders import from_vectors
from problems import Problem, load
from problems.cases import goddard
from transcription import DFET, NLP, Transcription, parse
from transcription.inner import inner_solver
from transcription.nlp.derivatives import gradients
from transcription.nlp.optimality import Linearised
from transcription.nlp.projection import metric_roots
from transcription.nlp.scalarized import scalarize

MESH = "dfet:4x4"
SPAN, LONGEST = 20.0, 4.0
"""Of the control and of the time of `carts`."""


def carts(unit: float = 1.0, scale: float | None = None, slope: float = 0.0, span: float = SPAN) -> Problem:
    """A cart from rest to rest: effort and time against the distance, which is maximised. E = 12 D^2/T^3. `unit` is one of lengths, `scale`
    that of the control; with a `slope`, the effort is weighed by e^(slope x time)."""
    problem = Problem("carts")
    run = problem.phase("run", t0=0.0, tf=(0.5, 0.5 + LONGEST))
    x = run.state("x", bounds=(-1 * unit, 5 * unit), initial=0)
    v = run.state("v", bounds=(-5 * unit, 5 * unit), initial=0, final=0)
    u = run.control("u", bounds=(-0.5 * span * unit, 0.5 * span * unit), scale=scale)
    run.dynamics(x=v, v=u)
    problem.minimize("effort", run.integral((u / unit) ** 2 * ca.exp(slope * run.time)))
    problem.minimize("time", run.tf, unit="s")
    problem.maximize("distance", run.final(x) / unit, unit="m")
    return problem


def optimum(problem: Problem, method: Transcription, time: float = 2.0, distance: float = 1.0) -> Front:
    """The least effort at a time and a distance, as a front of one point, by bounds that are no part of the problem whose point it is."""
    nlp = method.nlp(problem)
    found = scalarize(nlp, 0.5 * (nlp.lower + nlp.upper), reference=np.array([0.0, time, -distance]), weights=np.array([1.0, 0.0, 0.0]))
    assert found.status == "converged"
    return as_front(nlp, found.z)


def as_front(nlp: NLP, z: np.ndarray) -> Front:
    """A vector as a front of one point, about which nothing else is known."""
    return Front.of(from_vectors(nlp, z[None], {}, {"tolerance": 1e-6, "evaluations": 0, "gradient_solves": 1, "wall_time": 0.0}))


def exact_matrix(T: float, D: float) -> np.ndarray:
    """Of `carts`, from the projected gradients in closed form: u = 6 D/T^2 (1 - 2 s) at s = t/T; its mean and that of its variation are 0.

    The derivatives by u (times ds) and by T are, of the effort, 2 T u and 12 D^2/T^4; of the distance, T^2 (1/2 - s) and 2 D/T.
    """
    by_u = SPAN**2 * np.array([[48 * D**2 / T**2, 0.0, 2 * T * D], [0.0, 0.0, 0.0], [2 * T * D, 0.0, T**4 / 12]])
    by_T = np.array([12 * D**2 / T**4, 1.0, 2 * D / T])
    gram = by_u + LONGEST**2 * np.outer(by_T, by_T)
    return gram / np.diag(gram)[:, None]


MESHES = [
    DFET(4, 4),
    parse("radau:5x4"),
    parse("shooting:24:linear"),
    parse("multiple-shooting:9x2:rk8:spline:7"),
    DFET(3, 4, mesh={"run": ((0, 0.1, 0.35, 0.5, 1), 4)}),
]


@pytest.mark.parametrize("method", MESHES, ids=str)
def test_rates_and_matrix_of_three_objectives_in_closed_form(method):
    T, D = 2.0, 1.5
    found = trade_offs(optimum(carts(), method, T, D)[0])
    by = {"effort": 1.0, "time": 36 * D**2 / T**4, "distance": 24 * D / T**3}
    assert found.rate("effort", "time") == pytest.approx(-by["time"], rel=2e-3)
    assert found.rate("effort", "distance") == pytest.approx(by["distance"], rel=2e-3)
    assert found.rate("time", "distance") == pytest.approx(by["distance"] / by["time"], rel=2e-3)
    assert found.rate(1, 2) == found.rate("time", "distance") == pytest.approx(1 / found.rate(2, 1))
    assert found.matrix == pytest.approx(exact_matrix(T, D), rel=2e-3) and not found.messages


def test_units_and_scales_of_variables_do_not_matter():
    plain, other = (trade_offs(optimum(problem, parse(MESH))[0]) for problem in (carts(), carts(unit=1000.0, scale=3.0)))
    assert other.matrix == pytest.approx(plain.matrix, rel=1e-6)
    assert other.rates == pytest.approx(plain.rates, rel=1e-6)


@pytest.mark.slow
def test_where_controls_are_on_their_bounds_the_mesh_matters_by_an_element():
    """At both ends of the flight; how much of it is not held is known to about an element."""
    methods = [DFET(20, 3), DFET(20, 3, basis="bernstein"), parse("radau:24x3"), parse("shooting:60:linear"), parse("shooting:60")]
    points = [optimum(carts(slope=0.3, span=3.4), method, 2.0, 1.5)[0] for method in methods]
    held = [np.mean(np.abs(point.trajectory["run"].controls) > 1.699) for point in points]
    assert min(held) > 0.2
    first, *others = (trade_offs(point).matrix for point in points)
    assert not any(np.abs(one / first - 1.0).max() > 0.04 for one in others)


def along(point, direction: np.ndarray) -> np.ndarray:
    """Objectives (2, m) of feasible points a little to both sides of a point."""
    problem = point.compiled()
    nlp = parse(MESH).nlp(problem)
    both = np.array([point.decision + sign * 1e-3 * direction for sign in (-1, 1)])
    found = inner_solver("auto").solve(nlp, both[:, nlp.free], both, tolerance=1e-11)
    assert (found.status == "converged").all()
    return found.F * problem.signs


def test_matrix_and_rates_agree_with_differences_along_directions_and_of_other_optima():
    point = optimum(carts(slope=0.8), parse(MESH), 2.0, 1.5)[0]
    found = trade_offs(point)
    assert found.directions.shape == (3, len(point.decision))
    for i, goal in enumerate(point.goals):
        less, more = along(point, found.directions[i])
        assert (more - less)[i] == pytest.approx(-2e-3 * goal.sign, rel=1e-4), "better by one unit"
        assert (more - less) / (more - less)[i] == pytest.approx(found.matrix[i], rel=1e-3, abs=1e-5)
    # With the third objective held, at the nearest optima of a cart whose front is not known in closed form.
    problem, method, h = carts(slope=0.8), parse(MESH), 0.02
    for name, shift in (("time", (h, 0.0)), ("distance", (0.0, h))):
        less, more = (optimum(problem, method, 2.0 + s * shift[0], 1.5 + s * shift[1])[0].objectives["effort"] for s in (-1, 1))
        assert found.rate("effort", name) == pytest.approx((more - less) / (2 * h), rel=1e-3)


def test_no_direction_of_the_same_length_is_better():
    """Random variations along what is active, by the definition of the metric: the mean square of the control's, and that of the time."""
    method, rng = DFET(5, 3), np.random.default_rng(3)
    point = optimum(carts(slope=0.8), method, 2.0, 1.5)[0]
    nlp, found = method.nlp(point.compiled()), trade_offs(point)

    def length(variation: np.ndarray) -> float:
        s = np.linspace(0.0, 1.0, 20_001)[:-1] + 0.5 / 20_000
        flights = [nlp.unpack(point.decision + step * variation)["run"] for step in (0.0, 1e-3)]
        change = np.subtract(*(flight.control(flight.t0 + s * (flight.tf - flight.t0)) for flight in flights)) / 1e-3
        return float(np.sqrt(np.mean(change**2) / SPAN**2 + ((flights[1].tf - flights[0].tf) / 1e-3 / LONGEST) ** 2))

    gains = [1.0 / length(direction) for direction in found.directions]
    dF, dg = (np.array(one) for one in gradients(nlp)(point.decision)[:2])
    feasible = null_space(dg / nlp.g_scale[:, None], rcond=1e-10)
    for _ in range(50):
        variation = feasible @ rng.normal(size=feasible.shape[1]) + 0.1 * found.directions[rng.integers(3)]
        assert (np.abs(dF @ variation) / length(variation) <= np.array(gains) * (1 + 1e-6)).all()


def test_where_it_is_fastest_in_parameters():
    """Far from the wells, both get better together; between them, one at the expense of the other; in one of them, at no expense."""
    nlp = nlp_of(two_wells())

    def at(p: float, q: float):
        return trade_offs(as_front(nlp, vector(nlp, p=p, q=q))[0])

    def exact(p: float, q: float) -> np.ndarray:
        gradients = np.array([[p, q], [p - 1, q]])
        gram = gradients @ gradients.T
        return gram / np.diag(gram)[:, None]

    for p, q in ((-1.0, 0.5), (0.3, 0.2), (0.3, 0.0)):
        assert at(p, q).matrix == pytest.approx(exact(p, q))
    both = [f"the row of '{name}' has no negative entry: it and all others can get better together" for name in ("from left", "from right")]
    assert list(at(-1.0, 0.5).messages[1:]) == both and "not Pareto-optimal" in at(-1.0, 0.5).messages[0]
    assert len(at(0.3, 0.2).messages) == 1 and "not Pareto-optimal" in at(0.3, 0.2).messages[0]
    assert at(0.3, 0.0).messages == () and at(0.3, 0.0).rate(0, 1) == pytest.approx(-0.3 / 0.7)
    end = at(0.0, 0.0)
    assert end.messages == ("the row of 'from left' is degenerate: within what is active it can get no better",)
    assert end.matrix == pytest.approx(np.array([[1.0, np.nan], [0.0, 1.0]]), nan_ok=True, abs=1e-9)
    assert end.weights == {"from left": pytest.approx(1.0), "from right": pytest.approx(0.0, abs=1e-9)}
    assert np.isnan(end.directions[0]).all() and np.isfinite(end.directions[1]).all()


def test_what_is_active_is_held_and_what_has_no_multiplier_may_be_left():
    """Two wells above a floor: q is held where it counts. A floor through both wells has no multiplier, and descents stay on it."""
    floor = nlp_of(two_wells(q=(0.5, 2.0)))
    found = trade_offs(as_front(floor, vector(floor, p=0.3, q=0.5))[0])
    assert found.matrix == pytest.approx(np.array([[1.0, -0.7 / 0.3], [-0.3 / 0.7, 1.0]])) and not found.messages
    through = nlp_of(two_wells(q=(0.0, 2.0)))
    found = trade_offs(as_front(through, vector(through, p=0.3, q=0.0))[0])
    assert found.matrix == pytest.approx(np.array([[1.0, -0.7 / 0.3], [-0.3 / 0.7, 1.0]])) and not found.messages
    # From a wall at p = 0.3 that the best compromise of these weights touches, the left is near in one direction only.
    wall = two_wells()
    wall.constraint("wall", wall.parameters["p"] + 0 * wall.parameters["q"], lower=0.3)
    nlp = nlp_of(wall)
    found = trade_offs(as_front(nlp, vector(nlp, p=0.3, q=0.0))[0])
    assert found.matrix == pytest.approx(np.array([[1.0, np.nan], [-0.3 / 0.7, 1.0]]), nan_ok=True)
    assert found.messages == (
        "the row of 'from left' is degenerate: within what is active it can get no better",
        "an end, a corner or a sharp bend of the front: one more in 'from right' changes 'from left' by -0.4286 to 0",
    )
    assert found.bounds("from right", "from left") == pytest.approx((-np.inf, -0.7 / 0.3), rel=1e-4)
    assert trade_offs(as_front(nlp, vector(nlp, p=0.1, q=0.0))[0]).messages[0] == "not feasible: the violation is 2.0e-01"


def faces(*normals: tuple[float, ...], signs: tuple[int, ...] | None = None) -> TradeOffs:
    """At a corner of a front with flat faces of these normals, all through the point where each objective is 1."""
    problem = still("faces")
    x = [problem.parameter(f"p{k}", bounds=(-5, 5)) for k in range(len(normals[0]))]
    for k, (one, sign) in enumerate(zip(x, signs or (1,) * len(x), strict=True)):
        (problem.minimize if sign > 0 else problem.maximize)(f"J{k}", sign * one)
    for number, normal in enumerate(normals):
        problem.constraint(f"face {number}", sum(part * one for part, one in zip(normal, x, strict=True)), lower=sum(normal))
    nlp = nlp_of(problem)
    return trade_offs(as_front(nlp, vector(nlp, **{f"p{k}": 1.0 for k in range(len(x))}))[0])


def test_at_a_corner_the_rates_of_both_sides_are_said():
    found = faces((2.0, 1.0), (1.0, 2.0))
    assert found.bounds("J1", "J0") == pytest.approx((-2.0, -0.5), rel=1e-3)
    assert found.bounds("J0", "J1") == pytest.approx((-2.0, -0.5), rel=1e-3) and found.bounds(0, 0) == (1.0, 1.0)
    assert -2.0 <= found.rate("J1", "J0") <= -0.5
    assert "an end, a corner or a sharp bend of the front: one more in" in found.messages[-1] and "by -2 to -0.5" in found.messages[-1]
    # What is maximised gets more for more of the other.
    assert faces((2.0, 1.0), (1.0, 2.0), signs=(1, -1)).bounds("J1", "J0") == pytest.approx((0.5, 2.0), rel=1e-3)
    # Within a face all weights are known.
    flat = faces((2.0, 1.0))
    assert flat.bounds("J1", "J0") == pytest.approx((-2.0, -2.0), rel=1e-3) and not flat.messages
    found = faces((1.0, 1.0, 2.0), (2.0, 1.0, 1.0))
    assert found.bounds("J0", "J2") == pytest.approx((-2.0, -0.5), rel=1e-3)
    assert found.bounds("J0", "J1") == pytest.approx((-1.0, -0.5), rel=1e-3)
    assert "an end, a corner or a sharp bend of the front" in found.messages[-1]


def test_weights_are_not_moved_by_what_tells_multipliers_apart():
    """An objective p + d q with p above a wall, another r - d q with r on its bound: what q has on one side the other loses. The less d,
    the less of the residual is lost by other weights, which have smaller multipliers of the wall."""
    for d in (1e-5, 3e-6):
        problem = still("see-saw")
        p, q, r = (problem.parameter(name, bounds=(lower, 1)) for name, lower in (("p", -1), ("q", -1), ("r", 0)))
        problem.minimize("one", p + d * q)
        problem.minimize("other", r - d * q)
        problem.constraint("wall", p + 0 * q, lower=0)
        nlp = nlp_of(problem)
        found = trade_offs(as_front(nlp, vector(nlp, p=0.0, q=0.3, r=0.0))[0])
        assert found.rate("one", "other") == pytest.approx(-1.0, rel=2e-4)


@pytest.mark.parametrize("method", [DFET(4, 4), parse("radau:6x3")], ids=str)
def test_a_peak_as_an_objective(method):
    """Time T against the largest squared thrust, 16/T^4, which is bang-bang: every control is at the peak, and moves with it."""
    nlp = method.nlp(shuttle())
    start = nlp.first_guess(np.array([np.where(np.isfinite(nlp.guess), nlp.guess, 0.1)]))[0]
    found = scalarize(nlp, start, reference=np.array([2.0, 0.0]), weights=np.array([0.0, 1.0]))
    point = as_front(nlp, found.z)[0]
    assert point.objectives["largest thrust squared"] == pytest.approx(1.0, rel=1e-5)
    assert trade_offs(point).rate("largest thrust squared", "time") == pytest.approx(-64 / 2.0**5, rel=1e-4)
    assert trade_offs(point).matrix == pytest.approx(np.array([[1.0, -2.0], [-0.5, 1.0]]), rel=1e-3)


@pytest.mark.parametrize("c", [0.05, 0.2, 0.4, 0.49])
def test_a_peak_that_need_not_count_is_held_too(c):
    """At a constant control c the effort is 2 c^2, the miss (2 c - 1)^2, the largest x 2 c, and gradients are constant: 4 c, 4 (2 c - 1)
    and 2. The first two are enough for optimality."""
    problem = slide()
    run = problem.phases["run"]
    problem.minimize("highest", run.peak(run["x"]))
    nlp = nlp_of(problem)
    found = trade_offs(as_front(nlp, nlp.tighten(vector(nlp, u=c)[None])[0])[0])
    by_u = np.array([4 * c, 4 * (2 * c - 1), 2.0])
    assert found.matrix == pytest.approx(by_u / by_u[:, None], rel=1e-6)


def test_controls_that_switch_at_moving_edges():
    """A car that speeds up, rolls and brakes over a distance of 1: in a time 1/v + v with fuel 2 v, where v is its speed."""
    problem = Problem("car")
    run = problem.phase("run", t0=0.0, tf=(1.0, 5.0))
    x = run.state("x", bounds=(-1, 2), initial=0, final=1)
    v = run.state("v", bounds=(-2, 2), initial=0, final=0)
    push, brake = (run.control(name, bounds=(0, 1)) for name in ("push", "brake"))
    run.dynamics(x=v, v=push - brake + 0 * x)
    problem.minimize("time", run.tf)
    problem.minimize("fuel", run.integral(push + brake))
    mesh = {"edges": (0, 0.1, 0.2, 0.6, 0.8, 1), "order": 3, "control_order": 0, "moving": (2, 4)}
    method = DFET(5, 3, mesh={"run": mesh})
    nlp = method.nlp(problem)
    found = scalarize(
        nlp, nlp.first_guess(np.full((1, len(nlp.free)), 0.5))[0], reference=np.array([0.0, 1.0]), weights=np.array([1.0, 0.0])
    )
    point = as_front(nlp, found.z)[0]
    assert point.objectives == {"time": pytest.approx(2.5, rel=1e-6), "fuel": pytest.approx(1.0)}
    assert trade_offs(point).rate("time", "fuel") == pytest.approx(0.5 * (1 - 1 / 0.5**2), rel=1e-5)
    assert trade_offs(point).matrix == pytest.approx(np.array([[1.0, -1 / 1.5], [-1.5, 1.0]]), rel=1e-4)
    # A variation of the place of a switch is as long as its part of the duration, however far the mesh lets it move.
    roots = metric_roots(Linearised.of(nlp, found.z)).toarray()
    edges = [k for k, variable in enumerate(nlp.variables) if ".edge[" in variable.name]
    assert len(edges) == 2 and np.linalg.norm(roots[:, edges], axis=0) == pytest.approx(nlp.span[edges])


@pytest.fixture(scope="module")
def ascents() -> Front:
    return sweep(load("goddard"), parse("dfet:6x6"), points=12, method="epsilon", starts=1)


@pytest.mark.slow
def test_rates_are_the_slope_of_the_front_in_closed_form(ascents):
    for point in ascents[2:]:
        time = point.objectives["flight time"]
        slope = (goddard._speed(time + 1e-3) - goddard._speed(time - 1e-3)) / 2e-3
        found = trade_offs(point)
        assert found.rate("horizontal speed", "flight time") == pytest.approx(slope, rel=1e-4)
        assert front_rates(ascents[2:])[point.index] == pytest.approx(found.rates, nan_ok=True)
        assert found.rate("flight time", "horizontal speed") == pytest.approx(1 / slope, rel=1e-4)
        exact = np.array([[1.0, slope], [1 / slope, 1.0]])
        if time > 249.9:
            # The time may be no longer, only shorter.
            exact[1, 0] = np.nan
            assert found.messages[0] == "the row of 'horizontal speed' is degenerate: within what is active it can get no better"
            # At an end of the front: the rate there, and that of a limit.
            assert "an end" in found.messages[1] and len(found.messages) == 2
            assert found.bounds("flight time", "horizontal speed") == pytest.approx((1 / slope, np.inf), rel=1e-3)
        else:
            assert not found.messages
            assert found.bounds("flight time", "horizontal speed") == pytest.approx((1 / slope, 1 / slope), rel=1e-3)
        assert found.matrix == pytest.approx(exact, rel=1e-3, nan_ok=True)


def moved(front: Front, by: float, seed: int) -> Front:
    """A point whose control is moved by so much of its span, smoothly, and whose states follow, feasible again."""
    point = front[0]
    nlp = parse(MESH).nlp(point.compiled())
    z = point.decision.copy()
    (profile,) = nlp.profiles
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    z[nlp.free[profile.columns]] += by * SPAN * np.sin(2 * np.pi * profile.places * 2 + phase)
    found = inner_solver("auto").solve(nlp, z[nlp.free][None], z[None], tolerance=1e-10)
    assert found.status[0] == "converged" and found.moved[0] < 0.5
    return as_front(nlp, found.z[0])


@pytest.mark.parametrize(("by", "seed"), [(0.01, 0), (0.03, 1), (0.1, 2)])
def test_a_point_moved_off_the_front_is_found_out(by, seed):
    front = optimum(carts(), parse(MESH), 2.0, 1.5)
    assert trade_offs(front[0]).left < 1e-5
    found = trade_offs(moved(front, by, seed)[0])
    assert found.left > 1e-3
    assert "not Pareto-optimal" in found.messages[0] and "ot Pareto-optimal" in found.table()
    with pytest.raises(ValueError, match="not on a front"):
        found.rate("effort", "time")


def test_weights_of_another_point_are_found_out(ascents):
    stale = ascents.replace(costates=[*ascents.costates[4:], *ascents.costates[:4]])
    assert not trade_offs(ascents[5]).messages and "not Pareto-optimal" in trade_offs(stale[5]).messages[0]


def test_weights_that_are_zero():
    nlp = nlp_of(two_wells())
    found = trade_offs(as_front(nlp, vector(nlp, p=0.0, q=0.0))[0])
    # A little more of the left gains much of the right.
    assert abs(found.rate("from right", "from left")) > 1e6 and abs(found.rate("from left", "from right")) < 1e-6
    assert found.rate(0, 0) == found.rate(1, 1) == 1.0
    exact = np.array([[1, -np.inf, np.nan], [0, 1, 0], [np.nan, np.inf, 1]])
    signs = np.array([1.0, 1.0, -1.0])
    assert rates(np.array([0.0, 1.0, 0.0]), signs, np.zeros(3)) == pytest.approx(exact, nan_ok=True)
    # What is next to nothing beside the others over the range of the front is round-off, whatever its unit.
    assert rates(np.array([1e-9, 1.0, 1e-3]), signs, np.array([1.0, 1.0, 1e-6])) == pytest.approx(exact, nan_ok=True)
    assert np.isfinite(rates(np.array([1e-9, 1.0, 1e-3]), signs, np.array([1e6, 1.0, 1.0]))).all()


# Without the problem, and where there is nothing to say.


@pytest.mark.slow
def test_a_file_has_the_rates_and_says_what_the_matrix_needs(tmp_path):
    problem = carts()
    front = sweep(problem, parse(MESH), points=10, verify=None, starts=1)
    front.save(tmp_path / "front.nc")
    loaded = Front.load(tmp_path / "front.nc")
    for point, other in zip(front, loaded, strict=True):
        assert np.array_equal(trade_offs(other).rates, trade_offs(point).rates, equal_nan=True)
    inner = next(point for point, known in zip(loaded, front, strict=True) if np.isfinite(trade_offs(known).matrix).all())
    with pytest.raises(ValueError, match=r"need its problem.*Front.load\(path, problem=problem\)"):
        _ = trade_offs(inner).matrix
    assert trade_offs(inner).messages[0].startswith("no trade-off matrix: the gradients at point")
    text = trade_offs(inner).table()
    assert "No trade-off matrix" in text and "weight" in text
    assert trade_offs(inner, problem=problem).matrix == pytest.approx(trade_offs(front[inner.index]).matrix)
    with pytest.raises(ValueError, match="belongs to problem 'carts'"):
        trade_offs(inner, problem=load("goddard"))
    bare = loaded.replace(costates=[None] * len(loaded))
    with pytest.raises(ValueError, match="need its problem"):
        trade_offs(bare[0]).rate(0, 1)


def test_what_has_no_trade_offs(ascents):
    with pytest.raises(ValueError, match="black box"):
        trade_offs(black_box()[0])
    with pytest.raises(ValueError, match="one objective, 'time'"):
        trade_offs(optimize(load("standard/car"), parse("dfet:4x3"), verify=None, starts=1))
    with pytest.raises(ValueError, match="no objective 'speed'; there are flight time, horizontal speed"):
        trade_offs(ascents[3]).rate("speed", 0)
    for wrong in (2, -1, True):
        with pytest.raises(ValueError, match="no objective"):
            trade_offs(ascents[3]).rate(0, wrong)


@pytest.mark.slow
def test_a_choice_knows_what_it_costs():
    """Of the weighted sum of objectives in ranges, the rates follow from the weights."""
    ranges = Ranges(best={"flight time": 109.0, "horizontal speed": 0.9}, worst={"flight time": 250.0, "horizontal speed": 0.0})
    choice = decide(
        load("goddard"), parse("dfet:6x6"), WeightedSum({"flight time": 0.4, "horizontal speed": 0.6}), ranges=ranges, verify=None
    )
    assert choice.trade_offs.point is choice.point
    assert choice.trade_offs.rate("horizontal speed", "flight time") == pytest.approx((0.4 / 141.0) / (0.6 / 0.9), rel=1e-5)
    assert choice.trade_offs.matrix[0, 1] == pytest.approx((0.4 / 141.0) / (0.6 / 0.9), rel=1e-5)


def test_tables_and_pictures_of_points(ascents):
    found = trade_offs(ascents[5])
    lines = found.table().split("\n")
    (row,) = (line for line in lines if line.startswith("flight time"))
    assert row.split()[-2:] == ["-1", f"{-found.rate('horizontal speed', 'flight time'):.4g}"]
    (row,) = (line for line in lines if line.startswith("horizontal speed"))
    assert row.split()[-2:] == [f"+{found.rate('flight time', 'horizontal speed'):.4g}", "+1"]
    # Of three objectives, the matrix too.
    found = trade_offs(optimum(carts(), parse(MESH), 2.0, 1.5)[0])
    rows = [line.split() for line in found.table().split("\n") if line.startswith("distance")]
    assert rows[0][1:] == [f"{found.rate(0, 2):+.4g}", f"{found.rate(1, 2):+.4g}", "+1"]
    assert rows[1][1:] == [f"{found.matrix[2, 0]:+.4g}", f"{found.matrix[2, 1]:+.4g}", "+1"]
    assert [ax.get_title(loc="left") for ax in trade_offs(ascents[5]).plot()] == ["along the front, the rest held"]
    axes = trade_offs(optimum(carts(), parse(MESH), 2.0, 1.5)[0]).plot()
    assert len(axes) == 2
    assert [label.get_text() for label in axes[0].get_yticklabels()] == [
        "effort\nbetter by 1",
        "time\nbetter by 1 s",
        "distance\nbetter by 1 m",
    ]
    axes[0].figure.draw_without_rendering()


@pytest.mark.slow
def test_pictures_of_fronts(ascents):
    above, below = plot_rates(ascents)
    assert below.get_xlabel() == "\N{LEFTWARDS ARROW} flight time [s]" and below.get_yscale() == "log"
    assert len(above.lines) == len(ascents), "a dash for each point"
    front = sweep(carts(), parse(MESH), points=15, verify=None, starts=1)
    axes = plot_rates(front)
    assert len(axes) == 3
    axes[0].figure.draw_without_rendering()
    with pytest.raises(ValueError, match="no point of the front has weights"):
        plot_rates(ascents.replace(costates=[None] * len(ascents)))
    assert front_rates(ascents[:0]).shape == (0, 2, 2)
