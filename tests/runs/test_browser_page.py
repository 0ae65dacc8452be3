"""Pages for the browser, without one: their data are the front's, their texts stay texts, and wrong calls are one line."""

import base64
import gzip
import json
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from misbehaving import Crashing, Plain, glide
from synthetic_fronts import black_box, flights, marked, with_optional_phase
from test_study import Inline

from macs import optimize
from macs.fronts.curve import GAPS
from problems import load
from problems.compiled import Objective
from runs import Study
from runs.batch.store import Store
from runs.browser import page as pages
from runs.browser.pages import front_page, study_page
from runs.browser.points import LIMITS, curves, differences, thinned
from runs.cli import main
from transcription import parse
from transcription.trajectories.costates import Costates

pytest.importorskip("plotly")


class Reader(HTMLParser):
    """The elements of a page, and the texts of its scripts and its title."""

    def __init__(self, content: bytes) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.scripts: dict[str, str] = {}
        self.title = ""
        self._inside: tuple[str, str] | None = None
        self.feed(content.decode())

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._inside = (tag, dict(attrs).get("id") or "")

    def handle_endtag(self, tag):
        self._inside = None

    def handle_data(self, data):
        if self._inside and self._inside[0] == "script" and self._inside[1]:
            self.scripts[self._inside[1]] = self.scripts.get(self._inside[1], "") + data
        if self._inside and self._inside[0] == "title":
            self.title += data

    @property
    def data(self):
        return json.loads(self.scripts["page"])

    def block(self, name):
        return json.loads(gzip.decompress(base64.b64decode(self.scripts[f"block-{name}"])))


def values_of(told: list) -> np.ndarray:
    """The values of a curve as a page has it; NaN in gaps."""
    decimals, *steps = told
    gaps = np.array([step is None for step in steps], dtype=bool)
    whole = np.array([step for step in steps if step is not None], dtype=np.int64)
    for _ in range(LIMITS.order):
        whole = np.cumsum(whole)
    values = np.full(len(steps), np.nan)
    values[~gaps] = whole / 10.0**decimals if decimals >= 0 else whole * 10.0**-decimals
    return values


def test_all_numbers_of_a_front_are_those_of_the_page_to_the_last_bit():
    front = marked(flights(5), [True, False, True, True, True])
    found = Reader(front_page(front)).data
    (comparison,) = found["comparisons"]
    points = comparison["runs"][0]["points"]
    assert np.array_equal(np.array(points["objectives"]).T, front.objectives)
    assert np.array_equal(np.array(points["simulated"]).T, front.simulated_F * front.signs)
    assert points["violation"] == front.violation.tolist() and points["defect"] == front.defect.tolist()
    assert points["verified"] == front.verified.tolist()
    assert [goal["name"] for goal in comparison["goals"]] == list(front.names)


def test_curves_are_the_trajectory():
    front = flights(3)
    for point, told in zip(front, Reader(front_page(front)).block("0"), strict=True):
        assert [phase["name"] for phase in told["phases"]] == list(point.trajectory)
        for phase in told["phases"]:
            flight = point.trajectory[phase["name"]]
            for one in phase["quantities"]:
                times, values = values_of(phase["times"][one["t"]]), values_of(one["v"])
                inside = np.clip(times, flight.t0, flight.tf)
                if one["kind"] == "path":
                    assert np.allclose(values, flight[one["name"]], rtol=1e-6) and one["unit"] == "km²/s³"
                    continue
                exact = flight.at(inside)[one["name"]]
                near = np.abs(values - exact) <= 1e-5 * np.ptp(exact)  # times are rounded, too
                # Where a control jumps, the page has both values, `at` the later one.
                edges = np.isin(np.round(times, 4), np.round(flight.control.edges, 4))
                assert (near | edges).all() if one["kind"] == "control" else near.all()


def test_costates_are_those_of_the_point_and_have_units():
    point = optimize(load("goddard"), parse("dfet:4x6"), objective="horizontal speed", starts=1)
    (phase,) = curves(point.trajectory, point.costates, 400)
    adjoint = {one["name"]: one for one in phase["quantities"] if one["kind"] in ("costate", "hamiltonian")}
    units = {"x": "per km", "vx": "per km/s", "y": "per km", "vy": "per km/s", "Hamiltonian": "per s"}
    assert {name: one["unit"] for name, one in adjoint.items()} == units
    exact = {**point.costates["ascent"], "Hamiltonian": point.hamiltonian["ascent"]}
    for name, one in adjoint.items():
        assert values_of(one["v"])[[0, -1]] == pytest.approx(exact[name][[0, -1]], rel=1e-5, abs=1e-9)
    trajectory, costates = with_optional_phase(2e-6)
    climb, coast = curves(trajectory, costates, 400)
    assert (climb["lasts"], coast["lasts"]) == (True, False)
    assert {one["kind"] for one in coast["quantities"]} == {"state"}
    adjoint = [one for one in climb["quantities"] if one["kind"] in ("costate", "hamiltonian")]
    assert [one["name"] for one in adjoint] == ["h", "v", "Hamiltonian"]
    assert max(one["least"] for one in adjoint) < 1.0
    whole = curves(*with_optional_phase(1.0), 400)[1]
    assert whole["lasts"] and {one["kind"] for one in whole["quantities"]} == {"state", "costate", "hamiltonian"}


def test_a_front_with_slopes_is_a_curve_through_its_points_and_has_its_gaps():
    weights = np.column_stack([np.cos(angles := np.linspace(0.0, np.pi / 2, 8)), np.sin(angles)])
    costates = [Costates(one / one.sum(), {}) for one in weights]
    front = black_box(8, F=1.0 - weights, costates=costates, stats={GAPS: [(1.0 - weights[3:5, 0]).tolist()]})
    curve = Reader(front_page(front)).data["comparisons"][0]["runs"][0]["curve"]
    assert [piece["points"] for piece in curve["pieces"]] == [[0, 1, 2, 3], [4, 5, 6, 7]] and curve["error"] < 0.01
    for piece in curve["pieces"]:
        objectives = np.array(piece["objectives"])
        assert np.hypot(*(1.0 - objectives)) == pytest.approx(1.0, abs=1e-4) and len(piece["places"]) > 30
        own = [piece["places"].index(one) for one in piece["at"]]
        assert pytest.approx(front.objectives[piece["points"]]) == objectives[:, own].T
    assert Reader(front_page(black_box(8))).data["comparisons"][0]["runs"][0]["curve"] is None


def test_a_page_loads_nothing_and_stays_small():
    content = front_page(flights(10))
    assert len(content) < 6_000_000
    reader = Reader(content)
    assert not [tag for tag, attrs in reader.tags if "src" in attrs or (attrs.get("href") or "").startswith("http")]
    policy = next(attrs["content"] for _, attrs in reader.tags if attrs.get("http-equiv") == "Content-Security-Policy")
    assert "default-src 'none'" in policy and "connect-src 'none'" in policy
    assert front_page(flights(10)) == content  # the same bytes for the same front
    front = black_box(3).replace(message=EVIL)
    front.goals = (Objective(EVIL, EVIL), *front.goals[1:])
    before, after = Reader(front_page(black_box(3))), Reader(front_page(front))
    assert [tag for tag, _ in before.tags] == [tag for tag, _ in after.tags]
    assert after.data["comparisons"][0]["goals"][0]["name"] == EVIL
    named = Reader(pages.page({"title": EVIL, "comparisons": []}, {}))
    assert named.title == EVIL


EVIL = "</script><script>alert(1)</script><!-- {{style}} %{x} $a$ & <b>"


def test_thinned_curves_keep_their_pulses():
    values = np.zeros(10_000)
    values[[1234, 7000]] = 5.0, -3.0
    kept = thinned(values, 100)
    assert len(kept) <= 100 and {0, 1234, 7000, 9999} <= set(kept.tolist())


@given(st.lists(st.floats(-1e12, 1e12).map(lambda x: x if abs(x) > 1e-100 else 0.0), min_size=1, max_size=20))
def test_rounded_values_differ_by_a_millionth_of_their_range(values):
    array = np.array(values)
    found = values_of(differences(array))
    assert np.abs(found - array).max() <= max(1e-6 * np.ptp(array), 1e-10 * np.abs(array).max()) * 1.001


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("browser") / "out"
    solvers = {"one": Plain(), "other": Plain(agents=6), "broken": Crashing()}
    Study("gliders", problems=glide(), solvers=solvers, evaluations=60, runs=2, seed=1).run(out, executor=Inline())
    return out


@pytest.mark.slow
def test_the_page_of_a_study_has_its_runs_measures_tables_and_failures(folder):
    store = Store.open(folder, trust=True)
    reader = Reader(study_page(store))
    (comparison,) = reader.data["comparisons"]
    finished = [run for run in store.runs() if run.finished]
    assert [(run["solver"], run["number"]) for run in comparison["runs"]] == [(run.cell.solver, run.number) for run in finished]
    for told, run in zip(comparison["runs"], finished, strict=True):
        assert np.array_equal(np.array(told["points"]["objectives"]).T.reshape(-1, 2), run.front.objectives)
        assert len(reader.block(told["block"])) == len(run.front)
    progress = reader.data["progress"]
    assert (progress["finished"], progress["failed"], progress["total"]) == (4, 2, 6)
    assert "the root of all evil" in progress["failures"][0]["reason"] and "Traceback" in progress["failures"][0]["traceback"]
    assert set(comparison["attainment"]) <= {"one", "other", "broken"} and comparison["convergence"]
    assert any("points claimed" in one["caption"] for one in comparison["tables"])
    assert reader.data["tables"] == []


@pytest.mark.slow
def test_the_command_writes_pages_and_overwrites_no_front(folder, here, refused):
    flights(3).save("front.nc")
    assert main(["report", "front.nc"]) == 0 and Path("front.html").stat().st_size < 6_000_000
    assert main(["report", str(folder), "--html", "study.html", "--trust"]) == 0
    refused("report", "front.nc", "--html", "front.nc")
    assert sorted(path.name for path in here.iterdir()) == ["front.html", "front.nc", "study.html"]


def test_without_plotly_the_error_says_what_to_install(monkeypatch, refused):
    flights(3).save("front.nc")
    pages.plotly.cache_clear()
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    assert "pip install 'macs-trajectories[browser]'" in refused("report", "front.nc")
