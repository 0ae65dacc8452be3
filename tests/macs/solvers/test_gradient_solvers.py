"""Gradient tools as solvers: the same points as the tools, and what studies need of a solver."""

import numpy as np
import pytest
from rest_to_rest import DIAGONAL, MESH, RANGES, WIDE_E, WIDE_T, balanced, cart, effort, ends

from macs import Front, payoff, sweep
from macs.decision_solver import Decide
from macs.decisions import FuzzyGoal, FuzzySatisfactory, WeightedSum
from macs.gradient_solvers import Payoff
from macs.solvers.checkpoint import keeps
from macs.solvers.solver import solver
from problems import load
from transcription import parse

METHOD = parse("dfet:4x4")


@pytest.fixture(scope="module")
def goddard():
    return load("goddard")


@pytest.mark.slow
def test_they_find_what_the_tools_find(goddard):
    for own, tool in (
        (solver("payoff", starts=1), payoff(goddard, METHOD, starts=1)),
        (solver("sweep", points=4, starts=1), sweep(goddard, METHOD, points=4, starts=1)),
    ):
        front = own.solve(goddard, METHOD, evaluations=10, seed=0)
        np.testing.assert_array_equal(front.objectives, tool.objectives)
        assert "stopped" not in front.stats and front.stats["evaluations"] == 0
        assert front.stats["gradient_solves"] == tool.stats["gradient_solves"] > 0


def test_the_best_of_one_objective(goddard):
    front = solver("optimum", objective="horizontal speed", starts=1).solve(goddard, METHOD, seed=0)
    assert len(front) == 1 and front[0].objectives["horizontal speed"] == pytest.approx(
        payoff(goddard, METHOD, starts=1)[1].objectives["horizontal speed"]
    )


@pytest.mark.slow
def test_meshes_follow_on_request(goddard):
    method = parse("multiple-shooting:8:linear")
    fixed, dense = (solver("payoff", starts=1, mesh=mesh).solve(goddard, method, seed=0) for mesh in ("fixed", "density"))
    mended = solver("payoff", starts=1, mesh="mended").solve(goddard, METHOD, seed=0)
    assert not fixed.verified[0] and mended.verified.all()
    meshes = [one.trajectory["ascent"].state.edges for one in (fixed[0], dense[0])]
    assert len(meshes[0]) == len(meshes[1]) and np.ptp(np.diff(meshes[1])) > 1.0 > np.ptp(np.diff(meshes[0]))


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("payoff", {"starts": 0}, "Payoff: starts"),
        ("payoff", {"mesh": "fine"}, "Payoff: mesh"),
        ("sweep", {"points": 1}, "Sweep: points"),
        ("sweep", {"method": "weights"}, "Sweep: method"),
    ],
)
def test_settings_out_of_range_are_refused(name, settings, words):
    with pytest.raises(ValueError, match=words):
        solver(name, **settings)


def test_plain_functions_checkpoints_and_names_of_others_are_refused():
    with pytest.raises(ValueError, match="needs derivatives"):
        solver("payoff", starts=1).minimize(lambda X: X, [(0, 1), (0, 1)], evaluations=5)
    assert not keeps(solver("payoff", starts=1))
    with pytest.raises(ValueError, match="speed"):
        Decide(choices={"a": FuzzyGoal({"speed": 1.0})}).solve(cart(), MESH, seed=1, start=ends())


# Choices by preferences: the points that `decide` finds, in their order, with what was said of them


BOTH = {"effort": 1.0, "time": 1.0}
GOALS = {"method": "FuzzySatisfactory", "settings": {"targets": {}, "priorities": ["time", "effort"]}}
WHOLE = {"best": dict(RANGES.best), "worst": dict(RANGES.worst)}


def made(**settings) -> Front:
    return Decide(ranges=RANGES, **settings).solve(cart(), MESH, seed=1, start=ends())


def test_each_choice_is_the_optimum_of_its_preference_in_their_order():
    front = made(
        choices={"both": WeightedSum(BOTH), "least": {"method": "FuzzyGoal", "settings": {"targets": {"time": 0.5, "effort": 12 / 64}}}}
    )
    T = np.array([balanced(1 / WIDE_E, 1 / WIDE_T), DIAGONAL])
    np.testing.assert_allclose(front.objectives[:, 1], T, rtol=1e-4)
    np.testing.assert_allclose(front.objectives[:, 0], [effort(t) for t in T], rtol=3e-4)
    about = front.stats["choices"]
    assert [one["label"] for one in about] == ["both", "least"]
    # At the largest least membership of two goals, both are equal.
    assert about[1]["degrees"]["time"] == pytest.approx(about[1]["degrees"]["effort"], abs=1e-6)
    assert front.verified.all() and front.stats["verify"] == 1e-3


def test_a_setting_with_several_values_makes_several_choices():
    front = made(choices={"goals": {**GOALS, "vary": {"regulating": [0.0, 0.1]}}})
    assert [one["label"] for one in front.stats["choices"]] == ["goals, regulating 0", "goals, regulating 0.1"]
    # Eq. (53): (1/2 + lambda) d_time + (1/2 - lambda) d_effort.
    expected = [balanced((0.5 - x) / WIDE_E, (0.5 + x) / WIDE_T) for x in (0.0, 0.1)]
    np.testing.assert_allclose(front.objectives[:, 1], expected, rtol=1e-4)


def test_a_loop_ends_where_the_order_is_kept_and_has_its_steps():
    settings = {**GOALS["settings"], "regulating": 0.01}
    front = made(choices={"loop": {**GOALS, "settings": settings, "loop": True}})
    steps = front.stats["choices"][0]["steps"]
    assert [step["about"]["lambda"] for step in steps] == pytest.approx([0.01 * 2**k for k in range(len(steps))])
    assert all(step["about"]["kappa"] > 0 for step in steps[:-1]) and steps[-1]["about"]["kappa"] <= 0


def test_what_was_chosen_is_in_the_file_and_the_same_again(tmp_path):
    front = made(choices={"both": WeightedSum(BOTH)})
    front.save(tmp_path / "chosen.nc")
    again = Front.load(tmp_path / "chosen.nc")
    assert again.stats["choices"] == front.stats["choices"] and again.stats["ranges"] == WHOLE
    one, other = (made(choices={"both": WeightedSum(BOTH)}) for _ in range(2))
    assert one.decision.tobytes() == other.decision.tobytes()
    wanted = FuzzySatisfactory({}, ["time", "effort"], 0.2)
    (given,) = Decide(choices={"a": wanted}).preferences()
    assert given == ("a", wanted, False)


@pytest.mark.slow
def test_it_begins_at_a_sweep_or_a_file_or_the_payoff_table(tmp_path):
    ends().save(tmp_path / "ends.nc")
    choices = {"both": WeightedSum(BOTH)}
    fronts = [
        Decide(choices=choices, **more).solve(cart(), MESH, seed=1) for more in ({"sweep": 4}, {"known": str(tmp_path / "ends.nc")}, {})
    ]
    for front in fronts:
        np.testing.assert_allclose(front.objectives[0], fronts[0].objectives[0], rtol=1e-3)
    swept, read, begun = (front.stats["gradient_solves"] for front in fronts)
    assert read < begun and read < swept
    assert begun >= Payoff().solve(cart(), MESH, seed=1).stats["gradient_solves"] + 1


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "choices must be a table"),
        ({"choices": {"a": 3}}, "choice 'a' must be a preference"),
        ({"choices": {"a": {"method": "Wish"}}}, "choice 'a': unknown preference 'Wish'"),
        ({"choices": {"a": {**GOALS, "varied": {}}}}, "choice 'a': unknown key 'varied'"),
        ({"choices": {"a": {**GOALS, "vary": {"regulating": []}}}}, "a list of values"),
        ({"choices": {"a": {**GOALS, "vary": {"regulating": [-1.0]}}}}, "choice 'a, regulating -1'"),
        ({"choices": {"a": {**GOALS, "loop": 1}}}, "loop must be true or false"),
        ({"choices": {"a": {"method": "WeightedSum", "settings": {"weights": BOTH}, "loop": True}}}, "only FuzzySatisfactory has a loop"),
        ({"choices": {"a": GOALS}, "mesh": "adaptive"}, "mesh must be"),
        ({"choices": {"a": GOALS}, "sweep": 1}, "sweep"),
        ({"choices": {"a": GOALS}, "sweep": 3, "known": "a.nc"}, "without a sweep"),
        ({"choices": {"a": GOALS}, "ranges": {"best": {}}}, "ranges must be a table"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(settings, words):
    with pytest.raises(ValueError, match="Decide") as error:
        solver("decide", **settings)
    assert words in str(error.value) and "\n" not in str(error.value)
