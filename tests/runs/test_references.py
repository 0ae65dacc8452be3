"""Where references come from: files, closed forms, unions."""

import numpy as np
import pytest

from macs import Front
from problems.cases import goddard
from problems.compiled import Objective
from runs import gd, hypervolume
from runs.measures.references import closed_form, foreign, is_file, look_up, read, union

GOALS = (Objective("flight time", "s"), Objective("speed", "km/s", "maximize"))
A = np.array([[1.0, 1.0], [3.0, 3.0]])
B = np.array([[2.0, 2.5], [4.0, 3.0], [1.0, 0.5]])
BOTH = [[1.0, 1.0], [2.0, 2.5], [3.0, 3.0]]


def black_box(objectives: np.ndarray) -> Front:
    F = np.asarray(objectives) * [1, -1]
    return Front(F=F, decision=[[]] * len(F), violation=np.zeros(len(F)), status=["converged"] * len(F), goals=GOALS)


def test_the_union_is_of_fronts_and_arrays():
    for parts in ([black_box(A), black_box(B)], [black_box(A), B], [A, black_box(B)], [A, black_box(B), np.empty((0, 2))]):
        merged = union(parts)
        assert isinstance(merged, Front) and merged.objectives.tolist() == BOTH and merged.goals == GOALS
    plain = union([A * [1, -1], B * [1, -1]])
    assert sorted(plain.tolist()) == (np.array(BOTH) * [1, -1]).tolist()
    assert hypervolume(black_box(A), union([black_box(A), B])) == hypervolume(A * [1, -1], plain)
    assert len(union([np.empty((0, 2))])) == 0
    with pytest.raises(ValueError, match="front 1 has other objectives"):
        union([black_box(A), foreign(np.ones((1, 2)), GOALS[::-1]), A])
    with pytest.raises(ValueError, match="front 1 has 3 objectives, the other 2: flight time, speed"):
        union([black_box(A), np.ones((1, 3))])


def test_what_was_written_is_read(tmp_path):
    front = black_box(A)
    front.save(tmp_path / "a.nc")
    front.to_csv(tmp_path / "a.csv")
    for path in ("a.nc", "a.csv"):
        again = read(tmp_path / path, GOALS)
        assert again.objectives.tolist() == front.objectives.tolist() and again.goals == GOALS
    with pytest.raises(ValueError, match=r"objectives minimize flight time \[s\]"):
        read(tmp_path / "a.nc", GOALS[::-1])


@pytest.mark.parametrize(
    "text",
    [
        "speed, x, flight time [s]\n1.0, 7, 1.0\n3, 7, 3\n",
        "1.0,1.0\n\n3.0,3.0\n",
        "\ufeffflight time,speed [km/s],status\r\n1,1,converged\r\n0,nan,failed\r\n3,3,converged\r\n",
        "# of last week\n1.000000000000000000e+00 1.0e+00\n3.0 3.0\n",
        "flight time;speed;status\n1,0;1,0;converged\n3;3,0;converged\n",
        "# speed;flight time\n1;1\n3;3",
        "1\t1\n3\t3\n",
    ],
)
def test_tables_of_other_programs(tmp_path, text):
    path = tmp_path / "theirs.csv"
    path.write_text(text, encoding="utf-8")
    front = read(path, GOALS)
    assert front.objectives.tolist() == A.tolist() and front.solver["name"] == "theirs"
    assert gd(front, closed_form("goddard")) > 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("time,speed\n1,2\n", r"no column 'flight time \[s\]'; it has time, speed"),
        ("1,2\n1\n", "line 2: 1 columns, at least 2"),
        ("1,2\n1,nan\n", "line 2: '1', 'nan' should be 2 finite numbers"),
        ("flight time,speed,status\n1,2\n", "line 2: 2 columns, at least 3"),
    ],
)
def test_tables_that_are_none(tmp_path, text, words):
    path = tmp_path / "theirs.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        read(path, GOALS)
    with pytest.raises(ValueError, match="state the objectives"):
        read(path)


def test_what_is_a_file(tmp_path):
    for suffix in (".dat", ".txt", ".front", ""):
        np.savetxt(tmp_path / f"pf{suffix}", A)
        found = look_up(str(tmp_path / f"pf{suffix}"), "label", "", {}, GOALS)
        assert found is not None and found.front.objectives.tolist() == A.tolist()
    assert not any(map(is_file, ["goddard", "standard/car", "cases.py:build", "package.module:build"]))


def test_closed_forms():
    assert closed_form("goddard").tolist() == goddard.reference().tolist()
    assert closed_form("orbit_rise_full").shape == (241, 2)
    assert closed_form("problems.cases.goddard:problem").shape == (2001, 2)
    with pytest.raises(ValueError, match="there is no problem 'godard'"):
        closed_form("godard")
    assert closed_form("betts_heating").tolist() == [[30.6255]]
    with pytest.raises(ValueError, match=r"'landing_site' with landers = 2"):
        closed_form("landing_site", {"landers": 2})
    with pytest.raises(ValueError, match=r"no true front of 'problems\.sampling:"):
        closed_form("problems.sampling:problem")
