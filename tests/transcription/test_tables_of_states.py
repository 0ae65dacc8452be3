"""Tables of states that meshes do not follow: found along trajectories, and named in notes and by `explain`."""

import casadi as ca
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from macs import explain, optimize
from macs.baselines import NSGA2
from problems import Problem
from transcription import DFET
from transcription.trajectories.tables import MOST_TURNS, rough_tables

PLACES = np.linspace(-10.0, 110.0, 481)


def cart(values, kind="bspline", of=1.0):
    """A cart along a road of 100 m whose slope is a table of its place, or of `of` times it."""
    problem = Problem("road")
    table = ca.interpolant("slope", kind, [PLACES * of], values)
    ride = problem.phase("ride", t0=0, tf=(5, 60))
    x = ride.state("x", bounds=(0, 100), initial=0, final=100, unit="m")
    v = ride.state("v", bounds=(-20, 20), initial=0, final=0, unit="m/s")
    force = ride.control("force", bounds=(-2, 2), unit="m/s^2")
    ride.dynamics(x=v, v=force - 9.81 * table(of * x))
    problem.minimize("time", ride.tf, unit="s")
    return problem


def rough(problem):
    """The rough tables along the road at constant speed."""
    compiled = problem.compile()
    nlp = DFET(6, 5).transcribe(compiled)
    trajectory = nlp.unpack(nlp.first_guess(0.5 * (nlp.lower + nlp.upper)[nlp.free][None])[0])
    assert trajectory["ride"]["x"] == pytest.approx(100 * trajectory["ride"].time / trajectory["ride"].tf, abs=1e-6)
    return rough_tables(compiled, trajectory)


@pytest.mark.parametrize("kind", ["linear", "bspline"])
@pytest.mark.parametrize("of", [1.0, 3.6])
def test_a_table_that_turns_often_is_found_with_its_state_and_a_width_that_cures_it(kind, of):
    wave = 0.02 * np.sin(2 * np.pi * PLACES / 2.5)  # 40 periods of 2.5 m: 80 turns
    (found,) = rough(cart(wave, kind, of=of))
    assert (found.table, found.state, found.phase, found.grows) == ("slope", "x", "ride", True)
    assert found.turns == pytest.approx(80, abs=1) and found.unit == ("m" if of == 1.0 else None)
    assert ("'x'" if of == 1.0 else "an expression of 'x'") in str(found) and "independent variable" in str(found)
    assert 0 < found.width < 20 * of and 0.4 < found.change < 0.7  # the mean of the wave is 0: half of its range


def test_noise_is_smoothed_to_what_a_mesh_follows():
    rng = np.random.default_rng(0)
    noisy = 0.02 * np.sin(2 * np.pi * PLACES / 50) + rng.normal(0, 0.01, len(PLACES))
    (found,) = rough(cart(noisy))
    step = PLACES[1] - PLACES[0]
    left = rough(cart(gaussian_filter1d(noisy, 1.3 * found.width / step)))
    assert found.turns > 5 * MOST_TURNS and not left and 0.1 * step < found.width < 10.0


@pytest.mark.parametrize("values", [np.zeros(len(PLACES)) + 0.1 / 3, 0.02 * np.sin(2 * np.pi * PLACES / 50), np.tanh(PLACES - 50)])
def test_smooth_and_constant_tables_are_none(values):
    assert not rough(cart(0.1 * values, "linear"))


def test_the_note_names_the_table_and_explain_says_it():
    wave = 0.3 * np.sin(2 * np.pi * PLACES / 1.3)
    point = optimize(cart(wave), DFET(3, 3), starts=1)
    assert point.verified is not True
    text = explain(point)
    assert text.startswith(f"Point 0: {point.title}.\n") and "table 'slope' of 'x'" in text and "near t = " in text
    assert "is not verified" in text and "is verified" not in text


def test_explain_of_points_without_trajectories():
    box = NSGA2(population=8).minimize(lambda X: np.stack([X[:, 0], 1 - X[:, 0]], axis=1), [(0, 1)], evaluations=16, seed=0)
    assert explain(box[0]).endswith("There is nothing to verify of a black box.")
    assert explain(box) == "\n\n".join(explain(point) for point in box)
    with pytest.raises(TypeError, match="takes a point or a front, not dict"):
        explain({})
    good = optimize(cart(np.zeros(len(PLACES))), DFET(4, 4), starts=1)
    assert "It is verified" in explain(good)
    assert "It was not simulated" in explain(optimize(cart(np.zeros(len(PLACES))), DFET(4, 4), starts=1, verify=None))
