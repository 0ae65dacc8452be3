import csv

import numpy as np
import pytest
from vector_problems import parabolas

from macs import MACS, MOPSO, NSGA2, Front, optimize, payoff, sweep
from macs.decisions import Dialogue, ReferencePoint, decide
from macs.fronts.verification import verify
from macs.gradient_solvers import Sweep
from macs.solvers.checkpoint import Unreadable
from problems import load
from problems.cases.structures import four_bar_truss_reference
from transcription import DFET, Collocation, SingleShooting


@pytest.fixture(scope="module")
def front() -> Front:
    return MACS().solve(parabolas(), evaluations=1500, seed=1)


class Counted:
    """A function of rows, counting them."""

    def __init__(self) -> None:
        self.rows = 0

    def __call__(self, X: np.ndarray) -> dict[str, np.ndarray]:
        self.rows += len(X)
        x, y = X.T
        return {"near": x**2 + y**2, "nearness": -((x - 2) ** 2) - y**2, "wall": x}


def test_the_front_is_the_known_one_and_its_points_tables_pictures_and_choices_too(front, tmp_path):
    x = front.decision[:, 0]
    assert len(front) == 10 and (front.status == "converged").all()
    assert np.allclose(front.objectives[:, 1], -((x - 2) ** 2), atol=0.02)
    assert x.min() < 0.05 and 1.45 < x.max() <= 1.5 + 1e-6
    assert front.names == ("near", "nearness") and front.senses == ("minimize", "maximize")
    point = front[3]
    assert list(point.parameters) == ["x", "y"] and point.trajectory is None and point.transcription is None
    assert point.objectives["near"] == point.parameters["x"] ** 2 + point.parameters["y"] ** 2
    assert point.violations == {"wall": 0.0} and point.verified and point.simulated == point.objectives
    assert front.verified.all() and front.stats["verify"] == 1e-3 and front.stats["evaluated_again"] == 10
    again = point.simulate()
    assert again.objectives == point.objectives and again.violation == 0.0 and again.max_defect == 0.0
    table = front.table()
    assert "x" in table and "[m]" in table and "evaluated again, nothing differs" in table and "simulated" not in table
    front.to_csv(tmp_path / "front.csv")
    with (tmp_path / "front.csv").open() as file:
        head, first, *_ = csv.reader(file)
    assert head[:4] == ["point", "near [m2]", "nearness [m2]", "verified"] and head[5:7] == ["x [m]", "y"] and "defect" not in head
    assert "near, evaluated again [m2]" in head and float(first[5]) == front[0].parameters["x"]
    axes = front.plot_variables()
    assert [ax.get_ylabel() for ax in axes] == ["x [m]", "y"] and axes[0].figure.get_supxlabel() == "near [m²]"
    drawn = axes[0].collections[0].get_offsets()
    assert np.allclose(drawn, np.column_stack([front.objectives[:, 0], front.decision[:, 0]]))
    circled = front[3].plot()[0].collections[-1].get_offsets()
    assert np.allclose(circled, [[front[3].objectives["near"], front[3].parameters["x"]]])
    wish = ReferencePoint({"near": 0.5})
    assert wish.rank(front).best.objectives in [point.objectives for point in front]
    dialogue = Dialogue(front)
    dialogue.prefer(wish)
    assert "black box has no derivatives" in dialogue.choose().message


def test_solve_and_minimize_are_one_search():
    def plain(X):
        x, y = X.T
        return np.stack([x**2 + y**2, -((x - 2) ** 2) - y**2], axis=1), (x[:, None] - 1.5) / 1.5

    senses = ["minimize", "maximize"]
    for solver in (MACS(), NSGA2(population=20), MOPSO(particles=20, archive=20)):
        one = solver.solve(parabolas(), evaluations=400, seed=2)
        other = solver.minimize(plain, {"x": (-4, 4), "y": (-1, 1)}, senses=senses, evaluations=400, seed=2)
        assert np.array_equal(one.F, other.F) and np.array_equal(one.decision, other.decision)
    assert other.source is None and not other.was_simulated.any()


def test_rows_beyond_the_budget_are_those_of_the_fingerprint_and_those_evaluated_again():
    counted = Counted()
    found = MACS().solve(parabolas(function=counted), evaluations=200, seed=1)
    assert found.stats["evaluations"] == 200
    assert counted.rows == 200 + 8 + found.stats["evaluated_again"] == 208 + len(found)


@pytest.mark.slow
def test_the_truss_is_found_to_its_closed_form():
    found = MACS(archive=20).solve(load("four_bar_truss"), seed=1)
    truth = four_bar_truss_reference()
    ranges = np.ptp(truth, axis=0)
    distances = np.linalg.norm((found.objectives[:, None] - truth) / ranges, axis=2).min(axis=1)
    assert found.stats["stopped"] == "done" and found.stats["evaluations"] <= 20_000 and distances.mean() < 2e-3
    assert np.allclose(found.objectives.min(axis=0), truth.min(axis=0), rtol=1e-3)


def test_failed_rows_are_no_errors():
    def half(X):
        x, y = X.T
        return {"near": np.where(x < 0.5, np.nan, x**2), "nearness": -((x - 2) ** 2) - y**2, "wall": x}

    found = MACS().solve(parabolas(function=half), evaluations=300, seed=1)
    # Half of a Latin hypercube of 15 fails, then offspring of points near the edge: 47 in this search.
    assert found.stats["failures"]["failed"] > 30 and len(found) and found.decision[:, 0].min() >= 0.5
    none = MACS().solve(parabolas(function=lambda X: dict.fromkeys(("near", "nearness", "wall"), X[:, 0] * np.nan)), evaluations=50, seed=1)
    assert not len(none) and "all of them failed" in none.message

    def walled(X):
        return {"near": X[:, 0], "nearness": X[:, 1], "wall": 4.5 + 0.0 * X[:, 0]}

    found = MACS().solve(parabolas(function=walled), evaluations=60, seed=1)
    assert not len(found) and "the nearest violates wall by 2 of its scale, 1.5 m" in found.message
    assert found.closest is not None and found.closest.violations == {"wall": 2.0}

    class Tired(Counted):
        def __call__(self, X):
            if self.rows >= 108:
                raise RuntimeError("tired")
            return super().__call__(X)

    found = MACS().solve(parabolas(function=Tired()), evaluations=100, seed=1)
    # An error is a failed evaluation, also when points are evaluated again: these are kept, and not verified.
    assert len(found) and found.was_simulated.all() and not found.verified.any() and np.isnan(found.simulated_F).all()


def test_a_saved_front_is_evaluated_again_with_its_problem(front, tmp_path):
    path = tmp_path / "front.nc"
    front.save(path)
    alone = Front.load(path)
    assert alone.source.vector and not alone.dynamic and alone[2].parameters == front[2].parameters
    with pytest.raises(ValueError, match=r"'parabolas' was stated in a script.*pass it"):
        alone[0].simulate()
    with pytest.raises(ValueError, match=r"belongs to problem 'parabolas'.*values of the function differ"):
        Front.load(path, problem=parabolas(far=2.1))
    assert Front.load(path, problem=parabolas()).simulate().objectives.tolist() == front.objectives.tolist()
    with alone.to_xarray() as data:
        assert data["decision"].shape == (10, 2) and data["parameter"].values.tolist() == ["x", "y"]
        assert data["parameter_unit"].values.tolist() == ["m", ""]
    truss = MACS().solve(load("four_bar_truss"), evaluations=200, seed=1)
    truss.save(path)
    again = Front.load(path)
    assert again.verify(1e-9).verified.all() and again[0].simulate().objectives == truss[0].objectives


def test_what_is_not_what_it_says_is_not_verified_and_other_data_evaluate_the_same_points(front):
    wrong = front.replace(F=front.F + np.eye(10, 2) * 0.1 * np.ptp(front.F, axis=0))
    marked = wrong.verify()
    assert marked.verified.tolist() == [False, False] + [True] * 8
    assert "evaluated again, its 'near' differs by 0.2" in marked[0].note and marked[0].note.endswith("m2")
    assert "Not verified: evaluated again, these differ by more than 0.001." in marked.table()
    assert [check.ok for check in verify(wrong, tolerance=1e-6)] == [False, False] + [True] * 8
    other = front.simulate(parabolas(wall=1.0))
    x = front.decision[:, 0]
    assert np.allclose(other.violation, np.maximum(x - 1.0, 0.0)) and (other.status == np.where(x > 1.01, "infeasible", "converged")).all()
    with pytest.raises(ValueError, match="cannot be evaluated with 'four-bar truss': its variables are area 1"):
        front.simulate(load("four_bar_truss"))
    with pytest.raises(ValueError, match="no vector problem"):
        front.simulate(load("goddard"))


def test_what_needs_dynamics_or_derivatives_is_refused_in_one_line(front):
    problem = parabolas()
    word = "'parabolas' is a vector problem, which has no dynamics and no derivatives"
    refused = [
        lambda: MACS().solve(problem, DFET(2, 2), evaluations=10),
        lambda: MACS().solve(problem, inner="auto", evaluations=10),
        lambda: MACS().solve(problem, start="smooth", evaluations=10),
        lambda: MACS(mesh="adaptive").solve(problem, evaluations=10),
        lambda: MACS(polish_on="dfet:2x2:bernstein").solve(problem, evaluations=10),
        lambda: Sweep(points=5).solve(problem, evaluations=10),
        lambda: optimize(problem, starts=1),
        lambda: payoff(problem, starts=1),
        lambda: sweep(problem, points=5, starts=1),
        lambda: DFET(2, 2).transcribe(problem),
        lambda: SingleShooting(4).transcribe(problem),
        lambda: Collocation(2, 2).transcribe(problem),
        lambda: decide(problem, ReferencePoint({"near": 1.0})),
        lambda: Dialogue(front, problem),
        front.refine_mesh,
        front.mended,
        lambda: front.polished(DFET(2, 2)),
    ]
    for call in refused:
        with pytest.raises(ValueError, match=word):
            call()


def test_a_checkpoint_continues_to_the_same_bits(tmp_path):
    whole = MACS().solve(parabolas(), evaluations=400, seed=5)
    file = tmp_path / "run.ckpt"
    MACS().solve(parabolas(), evaluations=400, seed=5, checkpoint=file, callback=lambda progress: progress.evaluations > 150)
    rest = MACS().solve(parabolas(), evaluations=400, seed=5, checkpoint=file)
    assert np.array_equal(whole.F, rest.F) and np.array_equal(whole.decision, rest.decision) and rest.verified.all()
    with pytest.raises(Unreadable, match=r"problem.fingerprint"):
        MACS().solve(parabolas(far=3.0), evaluations=400, seed=5, checkpoint=file)
