"""Smooth first candidates: about the guess, within bounds, correlated in time, from the generator that is given."""

import numpy as np
import pytest

from macs import NSGA2
from problems import Problem
from transcription import DFET, Smooth
from transcription.smooth import smoothed, smoothing

MESHES = [DFET(20, 2), DFET(20, 2, basis="bernstein"), DFET(4, 3, mesh={"climb": ((0.0, 0.1, 0.15, 0.6, 1.0), 5)})]


def climb(**guesses) -> Problem:
    """A climb with two controls, one of them an angle all the way round, a free end and a parameter."""
    problem = Problem("climb")
    phase = problem.phase("climb", t0=0, tf=(8, 12))
    phase.state("y", bounds=(-100, 100), initial=(-1, 1))
    throttle, angle = phase.control("throttle", bounds=(0, 2)), phase.control("angle", bounds=(-180, 180), period=360)
    gain = problem.parameter("gain", bounds=(1, 3))
    phase.dynamics(y=throttle * gain + 0 * angle)
    problem.minimize("time", phase.tf)
    problem.maximize("height", phase.final(phase["y"]))
    phase.guess(**guesses)
    return problem


GUESS = {"throttle": (0.8, 1.2), "angle": 170.0, "tf": 9.0}


def columns(nlp, word: str) -> np.ndarray:
    return np.array([i for i, index in enumerate(nlp.free) if word in nlp.variables[index].name])


@pytest.mark.parametrize("mesh", MESHES, ids=lambda mesh: f"{mesh.basis}{mesh.elements}")
def test_profiles_tell_which_variables_are_a_control_and_when(mesh) -> None:
    nlp = mesh.transcribe(climb(throttle=([0, 12], [0.0, 2.0]), tf=12.0))
    assert [profile.name for profile in nlp.profiles] == ["climb.throttle", "climb.angle"]
    for profile, word in zip(nlp.profiles, ("throttle", "angle"), strict=True):
        assert np.array_equal(profile.columns, columns(nlp, word))
        assert (np.diff(profile.places) >= 0).all() and profile.places.min() >= 0 and profile.places.max() <= 1
    assert nlp.profiles[0].places == pytest.approx(nlp.guess[nlp.profiles[0].columns] / 2)  # a ramp from 0 to 2 is where it is


@pytest.mark.parametrize("mesh", MESHES, ids=lambda mesh: f"{mesh.basis}{mesh.elements}")
def test_candidates_vary_about_the_guess_within_bounds(mesh) -> None:
    problem = climb(**GUESS)
    nlp = mesh.transcribe(problem)
    lower, upper = nlp.lower[nlp.free], nlp.upper[nlp.free]
    X = Smooth(spread=0.1).draw(problem, mesh, 4000, np.random.default_rng(0))
    assert X.shape == (4000, len(nlp.free)) and ((lower <= X) & (upper >= X)).all()
    throttle = columns(nlp, "throttle")
    assert X[:, throttle].mean(axis=0) == pytest.approx(nlp.guess[throttle], abs=0.02)
    assert X[:, throttle].std(axis=0) == pytest.approx(0.2, rel=0.06)
    turned = (X[:, columns(nlp, "angle")] - 170 + 180) % 360 - 180  # the short way round, across the bound
    assert turned.mean(axis=0) == pytest.approx(0, abs=3)
    assert turned.std(axis=0) == pytest.approx(36, rel=0.06)
    end = columns(nlp, "climb.tf")
    assert X[:, end].mean() == pytest.approx(9, abs=0.02) and X[:, end].std() == pytest.approx(0.1 * 4, rel=0.06)
    gain = X[:, columns(nlp, "gain")]  # nobody guessed it
    assert gain.min() < 1.01 and gain.max() > 2.99 and gain.mean() == pytest.approx(2, abs=0.05)


def test_neighbours_in_time_are_alike_and_others_independent() -> None:
    mesh, problem = DFET(50, 1), climb(throttle=1.0)
    profile = mesh.transcribe(problem).profiles[0]
    X = Smooth(spread=0.1, length=0.1).draw(problem, mesh, 4000, np.random.default_rng(0))[:, profile.columns]
    found, apart = np.corrcoef(X.T), profile.places[:, None] - profile.places
    inside = np.ix_(*[(profile.places > 0.2) & (profile.places < 0.8)] * 2)  # near the ends there are fewer to average
    assert found[inside] == pytest.approx(np.exp(-(apart**2) / (2 * 0.1**2))[inside], abs=0.08)
    assert (np.diag(found, 1) > 0.9).all()


def test_smoothing_keeps_the_variance_and_a_short_length_everything() -> None:
    places = np.array([0.0, 0.3, 0.31, 1.0])
    assert (smoothing(places, 0.2) ** 2).sum(axis=1) == pytest.approx(1)
    assert smoothing(places, 1e-4) == pytest.approx(np.eye(4))
    assert smoothing(places, 1e4) == pytest.approx(np.full((4, 4), 0.5))
    # They are interpolated, also where places lie close to each other, and are no different.
    rng = np.random.default_rng(0)
    places = np.sort(np.concatenate([np.linspace(0.0, 1.0, 1200), 0.3 + 0.01 * rng.random(800)]))
    noise = rng.standard_normal((3, len(places)))
    for length in (0.05, 0.2, 3.0):
        assert np.allclose(smoothed(noise, places, length), noise @ smoothing(places, length).T, rtol=0, atol=1e-6)
    few = places[::4]
    assert np.array_equal(smoothed(noise[:, ::4], few, 0.2), noise[:, ::4] @ smoothing(few, 0.2).T)


@pytest.mark.parametrize("settings", [{"spread": 0}, {"spread": 1.5}, {"length": -1}, {"length": "long"}, {"spread": True}, {"guess": 1}])
def test_settings_that_make_no_sense(settings) -> None:
    with pytest.raises(ValueError, match=f"Smooth: {next(iter(settings))} must be"):
        Smooth(**settings)


def test_an_unknown_start_is_refused_before_any_work() -> None:
    with pytest.raises(ValueError, match="unknown start 'smoth', did you mean smooth"):
        NSGA2().solve(climb(), DFET(4, 2), evaluations=100, start="smoth")
    with pytest.raises(ValueError, match="start must be a Front, Points or an array"):
        NSGA2().minimize(lambda X: X, [(0, 1)] * 2, evaluations=100, start="smooth")
