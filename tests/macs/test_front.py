import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_fronts import black_box, compiled, empty, flights, marked, state_problem

from macs.front import Front
from macs.fronts.point import Point
from macs.fronts.provenance import ProblemSource
from macs.io.text import duration, numbers
from macs.pareto.dominance import nondominated
from problems.compiled import Variable


def test_a_front_is_sorted_by_its_first_objective_with_all_its_columns_which_are_read_only():
    front = flights(6, F=[[3, -1], [1, -5], [2, -3], [6, -9], [5, -8], [4, -2]])
    assert front.objectives[:, 0].tolist() == [1, 2, 3, 4, 5, 6]
    assert front.objectives[:, 1].tolist() == [5, 3, 1, 2, 8, 9]
    assert np.array_equal(front.F, front.objectives * [1, -1])
    assert front.names == ("time", "height") and front.units == ("s", "km") and front.senses == ("minimize", "maximize")
    F = [[3.0, 0.0], [np.nan, np.nan], [1.0, 0.0]]
    assert flights(3, F=F, sort=False).F[:, 0].tolist()[::2] == [3, 1]
    assert np.isnan(flights(3, F=F).F[2, 0])
    front = flights(
        3, F=[[3, 0], [1, 0], [2, 0]], violation=[0.3, 0.1, 0.2], status=["c", "a", "b"], excursions=[{"u": 3}, {"u": 1}, {"u": 2}]
    )
    assert [p.violation for p in front] == [0.1, 0.2, 0.3]
    assert [p.status for p in front] == ["a", "b", "c"]
    assert [p.excursions for p in front] == [{"u": 1}, {"u": 2}, {"u": 3}]
    front = flights()
    for array in (front.F, front.decision, front.violation, front[0].decision):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(ValueError, match="violation has 2 entries, F has 5 rows"):
        flights(5, violation=[0, 0])


def test_indexing_gives_points_and_fronts():
    front = flights(5)
    assert isinstance(front[0], Point) and isinstance(front[np.int64(-1)], Point)
    assert front[-1].objectives == {"time": front.objectives[4, 0], "height": front.objectives[4, 1]}
    for part, rows in ((front[1:4], [1, 2, 3]), (front[::-1], [4, 3, 2, 1, 0]), (front[[2, 0]], [2, 0]), (front[front.F[:, 0] > 15], None)):
        rows = np.flatnonzero(front.F[:, 0] > 15) if rows is None else rows
        assert isinstance(part, Front) and np.array_equal(part.F, front.F[rows])
        assert [p.trajectory for p in part] == [front[i].trajectory for i in rows]
    with pytest.raises(IndexError, match="point 5 of a front of 5"):
        front[5]
    assert len(list(front)) == len(front) == 5


def test_a_point_of_a_trajectory_front():
    point = flights()[2]
    assert point.parameters == dict(point.trajectory.parameters) and point.decision.shape == (4,)
    assert point.violations.keys() == {"climb.load", "link"}
    assert point.optimality is None and flights(1, optimality=[1e-9])[0].optimality == 1e-9
    assert np.array_equal(point.alone().F, point.F[None]) and "time" in repr(point)
    point = black_box()[0]
    assert point.trajectory is None and point.excursions is None
    assert point.parameters.keys() == {"span", "chord", "twist"}
    with pytest.raises(ValueError, match="black box"):
        point.simulate()


def test_the_problem_is_found_by_its_address_once(monkeypatch):
    calls = []
    monkeypatch.setattr("problems.load", lambda name, **data: calls.append((name, data)) or state_problem())
    front = flights(problem=ProblemSource("two legs", compiled().fingerprint, "two_legs", {"a": 1}, trusted=True))
    assert front.problem is None and front.compiled() is front.compiled()
    assert calls == [("two_legs", {"a": 1})]
    monkeypatch.setattr("problems.load", lambda name, **data: state_problem(speed=4.0))
    front = flights(problem=ProblemSource("two legs", compiled().fingerprint, "two_legs", trusted=True))
    with pytest.raises(ValueError, match="belongs to problem 'two legs'"):
        front[0].simulate()


def test_empty_fronts_have_a_message_and_the_closest_point_also_merged():
    front = empty()
    assert len(front) == 0 and front.F.shape == (0, 2) and front.objectives.shape == (0, 2)
    assert front.closest.violation == 0.25
    text = front.table()
    assert "no feasible point" in text and "climb.load" in text and "2.5e-01" in text
    with pytest.raises(IndexError, match=r"climb\.load"):
        front[0]
    merged = Front.merge([empty(closest=flights(1, violation=[0.5])[0], message="far"), empty()])
    assert len(merged) == 0 and merged.closest.violation == 0.25 and "climb.load" in merged.message
    assert Front.merge([black_box(0), black_box(0)]).closest is None
    stats = Front(F=np.empty((0, 2)), decision=[], violation=[], status=[], goals=compiled().goals).stats
    keys = ["evaluations", "inner_iterations", "gradient_solves", "failures", "wall_time", "seed", "tolerance", "versions", "reproducible"]
    assert set(keys) <= set(stats) and {"python", "numpy", "casadi"} <= set(stats["versions"])


def test_merging_keeps_what_nothing_dominates():
    fronts = [flights(7, seed) for seed in range(3)]
    merged = Front.merge(fronts)
    F = np.vstack([front.F for front in fronts])
    expected = F[nondominated(F)]
    assert np.array_equal(merged.F, expected[np.argsort(expected[:, 0])])
    assert merged[0].trajectory is not None and merged.problem is compiled()
    merged = Front.merge([flights(3, stats={"evaluations": 10, "failures": {"failed": 1}, "seed": 4, "wall_time": 1.0, "tolerance": 1e-6}),
                          flights(3, 1, stats={"evaluations": 32, "failures": {"failed": 2, "infeasible": 1}, "seed": 5, "wall_time": 0.5,
                                               "tolerance": 1e-8, "reproducible": False})])  # fmt: skip
    assert merged.stats["evaluations"] == 42 and merged.stats["wall_time"] == 1.5
    assert merged.stats["failures"] == {"failed": 3, "infeasible": 1}
    assert merged.stats["seed"] == [4, 5] and merged.stats["tolerance"] == 1e-6 and merged.stats["reproducible"] is False
    assert Front.merge([merged, merged]).stats["seed"] == [4, 5, 4, 5]


def test_points_of_different_meshes_merge_and_keep_their_own():
    more = [Variable(f"climb.u[{i}]", -1.0, 1.0, "km/s²", 2.0) for i in range(6)]
    fine = flights(
        2, 3, decision=np.arange(12.0).reshape(2, 6), variables=more, transcriptions={"method": "DFET", "settings": {"elements": 5}}
    )
    coarse = flights(3, F=[[5.0, 5.0], [6.0, 4.0], [7.0, 3.0]])
    merged = Front.merge([coarse, fine])
    assert len(merged.variables) == 6 and merged.decision.shape == (len(merged), 6)
    lengths = {len(point.decision): point.transcription["settings"]["elements"] for point in merged}
    assert lengths == {4: 3, 6: 5}
    for point in merged:
        assert [v.name for v in point.variables] == [f"climb.u[{i}]" for i in range(len(point.decision))]
        assert np.isfinite(point.decision).all()
    assert "2 meshes" in merged.table() and "elements" in merged.table(details=True)


def test_what_is_as_it_should_be_needs_no_details_and_parameters_are_shown():
    front = marked(flights(4), [True] * 4).replace(status=["converged"] * 4)
    parameters = [f"{flight.parameters['mass']:.5f}" for flight in front.trajectories]
    plain, full = front.table(), front.table(details=True)
    assert plain.splitlines()[2].split() == ["#", "time", "height", "mass", "status"]
    assert [line.split()[3] for line in plain.splitlines()[5:9]] == parameters
    assert [word in full for word in ("violation", "defect", "off by")] == [True] * 3
    assert "defect" in front.replace(verified=[True, False, True, True]).table(), "a point is not verified"
    assert "violation" in front.replace(status=["converged"] * 3 + ["infeasible"]).table()


def test_fronts_of_different_things_do_not_merge():
    other = state_problem(speed=4.0).compile()
    with pytest.raises(ValueError, match="'two legs' and 'two legs': the same name, but other bounds"):
        Front.merge([flights(), flights(problem=other)])
    with pytest.raises(ValueError, match="'two legs' and a black box"):
        Front.merge([flights(), black_box()])
    with pytest.raises(ValueError, match=r"minimize f0 \[kg\].*minimize f2"):
        Front.merge([black_box(m=2), black_box(m=3)])
    with pytest.raises(ValueError, match=r"different variables do not merge: span, chord, twist and span, chord"):
        Front.merge([black_box(), black_box(decision=np.zeros((6, 2)), variables=black_box().variables[:2])])
    with pytest.raises(ValueError, match="no front"):
        Front.merge([])


def test_a_table_has_a_row_for_each_point_and_warnings():
    front = flights(5)
    lines = front.table({"bound": [1e-9] * 5, "note": list("abcde")}).split("\n")
    assert lines[0] == "two legs: 5 points, DFET(elements=3, order=4), MACS, 1 000 evaluations, seed 7, 1.2 s"
    assert "min [s]" in lines[3] and "max [km]" in lines[3] and "bound" in lines[2] and "note" in lines[2]
    assert len([line for line in lines if "converged" in line]) == 5
    assert [line.split("converged", 1)[1].split()[-3:] for line in lines if "converged" in line][3:] == [
        ["u", "by", "0.38"],
        ["u", "by", "0.5"],
    ]
    assert "The points were not simulated: front.verify() does that" in lines[-1]
    assert max(map(len, lines)) < 140 and all(line == line.rstrip() for line in lines)
    with pytest.raises(ValueError, match="'bound' has 2 entries"):
        front.table({"bound": [0, 1]})
    front = black_box(4)
    assert "conflict" not in front.table()
    same = front.replace(F=np.column_stack([front.F[:, 0], np.full(len(front), 2.9) + 1e-9 * np.arange(len(front))]))
    assert f"'{same.names[1]}' is the same at all points: it is not in conflict with the other objectives." in same.table()
    assert "No other point was found that is better in any objective." in black_box(1).table()


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=6))
def test_any_number_can_be_shown(values):
    shown = numbers(values)
    assert len(shown) == len(values) and all(len(text) < 30 for text in shown)


def test_numbers_show_what_differs():
    assert numbers([1000.00001, 1000.00002]) == ["1000.00001000", "1000.00002000"]
    assert numbers([109.09461, 250]) == ["109.095", "250.000"]
    assert numbers([5.35104, 67069.2, 835267.4]) == ["5.3510", "67069     ", "835267     "], "points below each other"
    assert numbers([0.5, 1e-5, 1000]) == ["0.50000", "0.00   ", "1000.00   "]
    assert numbers([np.inf, 5.35104, np.nan]) == ["inf", "5.35104", "nan"], "what is no number has no digits"
    assert numbers([-0.0, 0.0]) == ["0.00000", "0.00000"]
    assert numbers([1e-9, 2e-9]) == ["1.00000e-09", "2.00000e-09"]
    assert numbers([2.97e-6, 0.159072, 0.90389], 9e-4) == ["0.0000", "0.1591", "0.9039"], "as far as they are verified"
    assert numbers([-2.97e-7, 0.159072, 0.90389], 9e-6) == ["0.000000", "0.159072", "0.903890"]
    assert numbers([109.09461, 250], 10.0) == ["109.1", "250.0"], "four digits of the range in any case"
    assert numbers([5.0, 5.00001], 1e-3) == ["5.00000", "5.00001"], "no digits of round-off"
    assert [duration(s) for s in (0.0123, 3.61, 59.7, 61, 7384)] == ["0.012 s", "3.6 s", "60 s", "1 min 01 s", "2 h 03 min"]
