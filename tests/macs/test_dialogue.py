"""A dialogue: what is asked for, undone, saved and gone on with; on a front in closed form, with its problem and without."""

import json
from functools import cache, reduce
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from rest_to_rest import DIAGONAL, MESH, WIDE_E, WIDE_T, cart, crossing, effort, in_time
from smooth_problems import corners, two_wells
from synthetic_fronts import black_box, empty, flights

from macs import Front, sweep
from macs.decisions import (
    Dialogue,
    FuzzyPhysicalProgramming,
    Larger,
    Nimbus,
    PhysicalProgramming,
    Ranges,
    ReferencePoint,
    Smaller,
    Value,
    WeightedSum,
)
from macs.decisions.improving import improved

HOPED = ReferencePoint({"effort": 10.0, "time": 0.7})
AT_HOPED = crossing((10, WIDE_E), (0.7, WIDE_T))
CLASSES = {"effort": Smaller(5, 10, 15, 25, 50), "time": Smaller(0.6, 0.8, 1.0, 1.3, 2.0)}


@cache
def front() -> Front:
    return sweep(cart(), MESH, points=9, starts=1)


def begun(**more: Any) -> Dialogue:
    return Dialogue(front(), cart(), MESH, **more)


def test_without_a_transcription_a_reference_point_is_solved_between_its_neighbours() -> None:
    choice = Dialogue(front(), cart()).choose(HOPED)
    assert choice.objectives["time"] == pytest.approx(AT_HOPED, rel=3e-6) and choice.point.verified
    assert choice.point.stats["gradient_solves"] == 1 and choice.point.transcription == front()[0].transcription


@pytest.mark.slow
def test_with_the_problem_choices_are_optima() -> None:
    dialogue = begun()
    first = dialogue.choose()
    assert first.objectives["time"] == pytest.approx(DIAGONAL, rel=3e-6) and first.point.verified
    dialogue.prefer(HOPED, "quick and cheap")
    second = dialogue.choose()
    assert second.objectives["time"] == pytest.approx(AT_HOPED, rel=3e-6) and second.message == ""
    assert dialogue.choose() is second
    # What is asked for is reached, and no more; what is given is not used up.
    third = dialogue.improve("time", to=0.8, giving={"effort": 40.0})
    assert third.objectives["time"] == pytest.approx(0.8, rel=1e-6) and third.objectives["effort"] == pytest.approx(effort(0.8), rel=1e-5)
    # It is not reached where that would take more than is given.
    fourth = dialogue.improve("time", to=0.55, giving={"effort": 30.0})
    assert fourth.objectives["time"] == pytest.approx(in_time(30.0), rel=1e-5)
    # As much as can be.
    fifth = dialogue.improve("effort")
    assert fifth.objectives["time"] == pytest.approx(4.0, rel=1e-5)
    words = ["near the best of all", "quick and cheap", "better time: 0.8, giving effort until 40"]
    assert [turn.asked for turn in dialogue.history][:3] == words
    assert [turn.choice for turn in dialogue.history] == [first, second, third, fourth, fifth]
    # What was chosen is known from now on: 9 points of the front, and those that are not of it.
    assert len(dialogue.known) == 9 + len(dialogue.found) and len(dialogue.found) >= 3
    assert third.trade_offs is not None
    assert third.trade_offs.rate("effort", "time") == pytest.approx(-36 / 0.8**4, rel=1e-3)


def test_physical_programming_moves_its_boundaries() -> None:
    dialogue = begun()
    dialogue.prefer(PhysicalProgramming(CLASSES))
    first = dialogue.choose()
    now = first.objectives
    second = dialogue.improve("time", to=0.7, giving={"effort": 45.0})
    assert isinstance(second.preference, PhysicalProgramming)
    classes = second.preference.classes
    assert classes["time"].boundaries == pytest.approx(np.linspace(0.7, now["time"], 5))
    # Stretched, so that the first stays and the last is the limit.
    assert classes["effort"].boundaries == pytest.approx([5 + (b - 5) * 40 / 45 for b in (5, 10, 15, 25, 50)])
    assert second.objectives["time"] < now["time"] - 1e-3 and second.objectives["effort"] < 45.0
    assert dialogue.history[0].preference == PhysicalProgramming(CLASSES) and dialogue.history[0].choice is first


def test_without_the_problem_points_are_ranked_and_the_message_says_so() -> None:
    dialogue = Dialogue(front())
    for choice in (dialogue.choose(), dialogue.improve("time", giving={"effort": 40.0}), *dialogue.alternatives(2)):
        assert any(choice.point is point or np.array_equal(choice.point.F, point.F) for point in front())
    assert "only points that are known were ranked, since there is no problem to solve" in dialogue.choose().message
    J = dialogue.choose().objectives
    better = [one for one in front().objectives if one[0] <= 40.0]
    assert J["time"] == min(one[1] for one in better) and dialogue.found == []
    box = Dialogue(black_box(12))
    assert "black box has no derivatives" in box.choose().message
    assert box.improve("f0").objectives["f0"] == black_box(12).F[:, 0].min()


def test_alternatives_are_others_about_the_choice() -> None:
    dialogue = begun()
    dialogue.prefer(HOPED)
    now = dialogue.choose().objectives
    found = dialogue.alternatives(4)
    assert len(found) == 4 and dialogue.alternatives_found == found
    # In turn, each objective is better than it is now, and the other worse.
    assert [one.objectives["effort"] < now["effort"] for one in found] == [True, False, True, False]
    assert [one.objectives["time"] < now["time"] for one in found] == [False, True, False, True]
    assert abs(found[2].objectives["effort"] - now["effort"]) > abs(found[0].objectives["effort"] - now["effort"])
    # The reference is a tenth of a range ahead in one objective.
    T = crossing((now["effort"] - 0.1 * WIDE_E, WIDE_E), (now["time"], WIDE_T))
    assert found[0].objectives["time"] == pytest.approx(T, rel=1e-4)
    assert all(one.preference == HOPED for one in found)
    taken = dialogue.take(2)
    assert dialogue.choice is taken is found[1] and dialogue.preference == HOPED and dialogue.history[-1].asked == "alternative 2"
    for number in (0, 5, True, "1"):
        with pytest.raises(ValueError, match="there is no alternative"):
            dialogue.take(number)  # type: ignore[arg-type]


@pytest.mark.slow
def test_alternatives_stay_within_hard_limits() -> None:
    dialogue = begun()
    dialogue.prefer(PhysicalProgramming({"effort": Smaller(5, 6, 7, 8, 12.0), "time": Smaller(0.6, 0.8, 1.0, 1.3, 2.0)}))
    assert np.isfinite(dialogue.choose().value)
    assert all(one.objectives["effort"] <= 12.0 * (1 + 1e-6) for one in dialogue.alternatives(4))


@pytest.mark.slow
def test_undone_saved_and_gone_on_with(tmp_path: Path) -> None:
    dialogue, path = begun(seed=3), tmp_path / "choice.json"
    dialogue.prefer(HOPED)
    dialogue.improve("time", giving={"effort": 40.0})
    dialogue.alternatives(2)
    dialogue.prefer(WeightedSum({"time": 1.0}))
    dialogue.save(path)
    again = Dialogue.load(path, cart())
    assert again.table() == dialogue.table() and again.ranges == dialogue.ranges and again.seed == 3
    assert again.transcription == MESH and again.problem is not None and again.preference == WeightedSum({"time": 1.0})
    assert [one.objectives for one in again.history[1].alternatives] == [one.objectives for one in dialogue.history[1].alternatives]
    for turn, other in zip(dialogue.history, again.history, strict=True):
        assert turn.preference == other.preference and turn.asked == other.asked
        if turn.choice is None:
            assert other.choice is None
        else:
            assert other.choice is not None and other.choice.values == turn.choice.values and other.choice.degrees == turn.choice.degrees
            assert other.choice.point.decision.tobytes() == turn.choice.point.decision.tobytes()
            assert other.choice.point.verified and other.choice.message == turn.choice.message
    for one in (dialogue, again):
        one.undo()
        one.take(1)
        one.undo()
        one.undo()
        assert len(one.history) == 1 and one.preference == HOPED
    # The same bits from there on.
    one, other = (each.improve("effort", to=5.0) for each in (dialogue, again))
    assert one.point.decision.tobytes() == other.point.decision.tobytes() and one.values == other.values


def test_files_are_read_by_others_and_computed_again(tmp_path: Path) -> None:
    dialogue, path = begun(), tmp_path / "choice.json"
    dialogue.choose()
    dialogue.save(path)
    assert Dialogue.load(path).problem is None
    with pytest.raises(ValueError, match="belongs to problem 'cart'"):
        Dialogue.load(path, two_wells())
    dialogue, path = Dialogue(front()), tmp_path / "choice.json"
    now = dialogue.choose()
    dialogue.improve("time")
    dialogue.save(path)
    data = json.loads(path.read_text(), parse_constant=lambda word: pytest.fail(word))
    assert data["choice"]["objectives"] == dialogue.choose().objectives and data["senses"]["time"] == "minimize"
    assert data["history"][0]["choice"]["degrees"] == now.degrees
    assert data["history"][1]["choice"]["degrees"]["effort"] is None
    # They are computed again, not believed.
    data["choice"]["objectives"]["time"] = data["history"][0]["choice"]["degrees"]["time"] = -5.0
    path.write_text(json.dumps(data))
    assert Dialogue.load(path).table() == dialogue.table()
    path = tmp_path / "x.json"
    for content, words in (("", "not JSON"), ("{", "not JSON"), ("[]", "something else"), ("[" * 100_000, "nested too deeply")):
        path.write_text(content)
        with pytest.raises(ValueError, match=words):
            Dialogue.load(path)
    with pytest.raises(FileNotFoundError, match="there is no file"):
        Dialogue.load(tmp_path / "none.json")
    with pytest.raises(OSError, match="there is no folder"):
        Dialogue(front()).save(tmp_path / "none" / "x.json")


@pytest.mark.parametrize(
    ("keys", "to", "words"),
    [
        (["format"], "x", "something else"),
        (["version"], 9, "its format is version 9"),
        (["more"], 9, "unknown field `more`"),
        (["front"], 0, "cannot have 0 of a front"),
        (["front"], 99, "cannot have 99 of a front"),
        (["points"], "%", "its points are damaged"),
        (["points"], "AAAA", "its points are damaged"),
        (["seed"], -1, "seed"),
        (["ranges"], {"best": {}}, "its ranges must have"),
        (["ranges", "best", "tyme"], 1.0, "ranges need the best and the worst value of 'tyme'"),
        (["transcription"], {"method": "os"}, "unknown transcription 'os'"),
        (["history", 0, "preference", "method"], "os.system", "unknown preference 'os.system'"),
        (["history", 0, "preference", "settings", "aspiration"], {"tyme": 1.0}, "unknown objective 'tyme'"),
        (["history", 0, "choice", "point"], 99, "it has no point 99"),
        (["history", 0, "choice", "point"], "x", "Expected `int`"),
    ],
    ids=lambda one: ".".join(map(str, one)) if isinstance(one, list) else "",
)
def test_damaged_files_are_one_line(tmp_path: Path, keys: list[Any], to: Any, words: str) -> None:
    dialogue, path = Dialogue(front()), tmp_path / "choice.json"
    dialogue.choose()
    dialogue.save(path)
    data = json.loads(path.read_text())
    place = reduce(getitem, keys[:-1], data)
    place[keys[-1]] = to
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError) as caught:
        Dialogue.load(path)
    said = str(caught.value)
    assert words in said and said.startswith(f"{path} does not hold a dialogue that can be read: ") and "\n" not in said


def test_what_is_wrong_adds_no_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    dialogue = Dialogue(front())
    now = dialogue.choose().objectives
    calls: list[tuple[Any, str]] = [
        (lambda: dialogue.improve("tyme"), "unknown objective 'tyme', did you mean time"),
        (lambda: dialogue.improve("time", giving={"tyme": 1.0}), "unknown objective 'tyme'"),
        (lambda: dialogue.improve("time", giving={"time": 1.0}), "cannot both improve and give way"),
        (lambda: dialogue.improve("time", to=3.9), "which is not better than it is"),
        (lambda: dialogue.improve("time", to=0.1), "lies beyond its range"),
        (lambda: dialogue.improve("time", to="fast"), "must be a number"),
        (lambda: dialogue.improve("time", giving={"effort": now["effort"] - 1}), "which is better than"),
        (lambda: dialogue.alternatives(0), "k must be a whole number"),
        (lambda: dialogue.prefer("time"), "preference must be a Preference"),
        (lambda: dialogue.prefer(ReferencePoint({"time": 9.0})), "beyond its range"),
        (lambda: dialogue.prefer(PhysicalProgramming({"time": Larger(5, 4, 3, 2, 1)})), "minimized, so that it cannot be of class Larger"),
    ]
    for call, words in calls:
        with pytest.raises(ValueError) as caught:
            call()
        assert words in str(caught.value) and "\n" not in str(caught.value)
        assert len(dialogue.history) == 1
    dialogue.improve("time")
    with pytest.raises(ValueError, match="'time' is at its best value"):
        dialogue.improve("time")

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    dialogue = begun()
    now = dialogue.choose()
    monkeypatch.setattr("macs.decisions.dialogue.decide", interrupted)
    with pytest.raises(KeyboardInterrupt):
        dialogue.improve("time")
    assert len(dialogue.history) == 1 and dialogue.choose() is now


def test_what_no_dialogue_is_about() -> None:
    calls: list[tuple[Any, str]] = [
        (lambda: Dialogue(3), "a dialogue is about a front, not 3"),  # type: ignore[arg-type]
        (lambda: Dialogue(empty()), "no feasible point to choose"),
        (lambda: Dialogue(black_box(), cart()), "black box: it has no problem"),
        (lambda: Dialogue(flights(), cart()), "belongs to problem 'two legs'"),
        (lambda: Dialogue(front(), cart(), "dfet:4x3"), "transcription must be a Transcription"),  # type: ignore[arg-type]
        (lambda: Dialogue(front(), ranges=Ranges({"effort": 1.0}, {"effort": 2.0})), "the ranges have no 'time'"),
        (lambda: Dialogue(front()).plot(), "nothing was chosen yet"),
        (lambda: Dialogue(front()).undo(), "nothing to undo"),
    ]
    for call, words in calls:
        with pytest.raises(ValueError, match=words):
            call()


def test_classes_on_two_sides_are_drawn_together() -> None:
    point, ranges = front()[4], Ranges.of(front())
    T = point.objectives["time"]
    around = Value(T - 1.4, T - 1.2, T - 1.0, T - 0.8, T - 0.6, T - 0.4, T - 0.2, T, T + 0.2)
    new = improved(PhysicalProgramming({"time": around}), ranges, point, "time")
    assert isinstance(new, PhysicalProgramming)
    # 0.6 of the 0.8 from the ideal value to the end.
    assert new.classes["time"].boundaries == pytest.approx([T - 0.6 + 0.75 * d for d in (-0.8, -0.6, -0.4, -0.2, 0, 0.2, 0.4, 0.6, 0.8)])
    with pytest.raises(ValueError, match="improve it without a value"):
        improved(PhysicalProgramming({"time": around}), ranges, point, "time", to=T - 0.3)
    ideal = Value(T - 1.4, T - 1.2, T - 1.0, T - 0.8, T, T + 0.4, T + 0.6, T + 0.8, T + 1)
    with pytest.raises(ValueError, match="is ideal as it is"):
        improved(PhysicalProgramming({"time": ideal}), ranges, point, "time")
    # One that was free gets a class, and those that are not given keep their values.
    fuzzy = improved(FuzzyPhysicalProgramming({"effort": CLASSES["effort"]}), ranges, point, "time")
    assert isinstance(fuzzy, FuzzyPhysicalProgramming) and fuzzy.classes["time"].boundaries[-1] == pytest.approx(T)
    three = improved(HOPED, ranges, point, "time")
    assert three == Nimbus(point, improve=["time"], free=["effort"])


@pytest.mark.slow
def test_the_history_is_drawn() -> None:
    dialogue = Dialogue(front())
    dialogue.choose()
    axes = dialogue.plot(figure=Figure(layout="constrained"))
    assert len(axes) == 3 and [len(axes[0].containers), len(axes[0].containers[0])] == [2, 1]
    dialogue.prefer(PhysicalProgramming(CLASSES))
    dialogue.choose()
    # Degrees of one preference for all turns where they go opposite ways.
    axes = dialogue.plot(figure=Figure(layout="constrained"))
    assert axes[0].get_ylabel().endswith("all turns by reference point")
    heights = [bar.get_height() for bar in axes[0].containers[1]]
    J = np.array([[*turn.choice.objectives.values()] for turn in dialogue.history if turn.choice])
    by = dialogue.history[0].preference
    assert heights == pytest.approx(by.degrees(dialogue.goals, dialogue.ranges, J)[:, 1])
    assert list(axes[2].lines[-1].get_ydata()) == pytest.approx(J[:, 1])
    assert len(dialogue.plot(PhysicalProgramming(CLASSES), Figure(layout="constrained"))) == 3


@pytest.mark.slow
def test_more_objectives() -> None:
    front = sweep(corners(), MESH, points=15, starts=1)
    dialogue = Dialogue(front, corners(), MESH)
    dialogue.choose()
    now = dialogue.choose().objectives
    # Those that are not named keep their values, those of `giving` their limits.
    limit = now["from 1"] + 0.3
    after = dialogue.improve("from 0", giving={"from 1": limit}).objectives
    assert after["from 0"] < now["from 0"] - 0.05 and after["from 1"] <= limit + 1e-5 and after["from 2"] <= now["from 2"] + 1e-5
    assert len(dialogue.plot(figure=Figure(layout="constrained"))) == 4
