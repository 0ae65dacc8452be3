"""Problems with a function of another problem's objectives in their place."""

from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from smooth_problems import shuttle, two_wells, with_peak

from problems import Problem, load
from problems.valued import ObjectiveBox, Valued, valued
from transcription import DFET


@dataclass(frozen=True)
class Aim:
    value: Any
    groups: Any = field(default=lambda J: [])
    limits: Any = field(default=lambda J: [])
    name: str = "aim"


def box(best: list[float], worst: list[float], room: float = 3.0) -> ObjectiveBox:
    low, high = np.minimum(best, worst), np.maximum(best, worst)
    return ObjectiveBox(np.array(best), np.array(worst), low - room * (high - low), high + room * (high - low))


def bent(J: Any, peaks: Any) -> Any:
    return (J[0] + 3) ** 2 / 10 + J[1] / 4 + 2 * peaks[0] ** 3


AIM = Aim(bent, lambda J: [[J[0] - 1, J[1] / 3, 0.2]], lambda J: [J[1] - 5.0])


def two_wells_valued(**more: Any) -> Valued:
    return valued(two_wells().compile(), AIM, box([0.0, 0.0], [1.0, 1.0]), **more)


def lifted(derived: Valued, mesh: DFET, rng: np.random.Generator, count: int = 5) -> tuple[Any, Any, np.ndarray, np.ndarray]:
    own, nlp = mesh.transcribe(derived.original), mesh.transcribe(derived.problem)
    Z = own.first_guess(own.lower[own.free] + rng.random((count, len(own.free))) * own.span[own.free])
    return own, nlp, Z, derived.lifted(own.variables, nlp.variables, Z, own.evaluate(Z)[0])


def test_vectors_go_there_and_back() -> None:
    derived = two_wells_valued(zero=0.7)
    own, nlp, Z, there = lifted(derived, DFET(2, 2), np.random.default_rng(0))
    F = own.evaluate(Z)[0]
    for z, f, vector in zip(Z, F, there, strict=True):
        assert (derived.dropped(nlp.variables, own.variables, vector) == z).all()
        inside = (derived.further[0].lower < f[0] < derived.further[0].upper) and (
            derived.further[1].lower < f[1] < derived.further[1].upper
        )
        if inside:
            value = bent(f, [max(f[0] - 1, f[1] / 3, 0.2)])
            assert derived.value(nlp.evaluate(vector[None])[0][0, 0]) == pytest.approx(value, rel=1e-12)
            # All that ties the parameters to what they stand for holds; what is left are the states, and the limit.
            violations = nlp.violations(vector)
            assert max(violations[f"constraint 'objective '{name}''"] for name in ("from left", "from right")) < 1e-12
            assert violations["constraint 'maximum 0'"] < 1e-12
            assert violations["constraint 'limit of aim'"] == pytest.approx(max(f[1] - 5.0, 0.0))


def test_names_and_numbers_of_the_user_are_no_obstacle() -> None:
    problem = two_wells()
    problem.parameter("value of from left", bounds=(-1, 1))
    problem.parameter("maximum 0", bounds=(-1, 1))
    derived = valued(problem.compile(), AIM, box([0.0, 0.0], [1.0, 1.0]))
    names = [v.name for v in derived.problem.parameters]
    assert len(set(names)) == len(names) == 7
    own, nlp, Z, there = lifted(derived, DFET(2, 2), np.random.default_rng(0))
    assert (derived.dropped(nlp.variables, own.variables, there[0]) == Z[0]).all()
    assert np.isfinite(derived.lifted(own.variables, nlp.variables, Z, np.full((len(Z), 2), np.nan))).all()
    assert derived.lifted(own.variables, nlp.variables, Z[:0], np.empty((0, 2))).shape == (0, len(nlp.variables))


def test_what_rises_is_bounded_and_what_does_not_is_equal() -> None:
    rows = {limit.name: (limit.lower, limit.upper) for limit in two_wells_valued().problem.limits}
    assert rows["objective 'from left'"] == rows["objective 'from right'"] == (-np.inf, 0.0)
    around = Aim(lambda J, peaks: peaks[0] + J[1], lambda J: [[J[0] - 0.5, 0.5 - J[0]]])
    limits = valued(two_wells().compile(), around, box([0.0, 0.0], [1.0, 1.0])).problem.limits
    assert {limit.name: limit.lower for limit in limits} == {
        "objective 'from left'": 0.0,
        "objective 'from right'": -np.inf,
        "maximum 0": -np.inf,
    }
    # A maximised objective rises the other way.
    problem = Problem("up")
    problem.phase("wait", t0=0, tf=1).state("x", bounds=(-1, 1), initial=0)
    problem.phases["wait"].dynamics(x=0)
    p = problem.parameter("p", bounds=(0, 1))
    problem.maximize("height", p)
    for slope, lower in ((-1.0, -np.inf), (1.0, 0.0)):
        aim = Aim(lambda J, peaks, slope=slope: slope * J[0])
        assert valued(problem.compile(), aim, box([1.0], [0.0])).problem.limits[0].lower == lower
    derived = valued(two_wells().compile(), Aim(lambda J, peaks: 2 * J[1]), box([0.0, 0.0], [1.0, 1.0]))
    assert derived.names == ("from right",) and len(derived.further) == 1
    first = Aim(lambda J, peaks: peaks[0], lambda J: [[J[0], 0.0]], name="first")
    derived = valued(two_wells().compile(), Aim(lambda J, peaks: J[1]), box([0.0, 0.0], [1.0, 1.0]), kept=[(first, 0.25)])
    limit = next(limit for limit in derived.problem.limits if limit.name == "value of first")
    assert (limit.lower, limit.upper) == (-np.inf, 0.25)


def test_several_phases_keep_their_dynamics() -> None:
    problem = load("skip").compile()
    derived = valued(problem, Aim(lambda J, peaks: -J[0] / 1e5 - J[1] ** 2 / 1e7), box([89e3, 7800.0], [36e3, 4800.0]))
    rng = np.random.default_rng(0)
    for phase, own in zip(derived.problem.phases, problem.phases, strict=True):
        x, u = (np.array([rng.uniform(v.lower, v.upper) for v in group]) for group in (own.states, own.controls))
        s = np.array([own.t0.lower, own.tf.upper, *(v.lower for v in problem.parameters)])
        for name in ("dynamics", "path", "initials", "finals", "integrands", "peaks"):
            one, other = getattr(own, name), getattr(phase, name)
            assert (np.array(one(x, u, s[1], s)) == np.array(other(x, u, s[1], np.append(s, [1.0, 2.0])))).all()


def test_peaks_may_be_lowered_only() -> None:
    problem = shuttle().compile()
    ranges = box([1.0, 0.2], [3.0, 16.0])
    derived = valued(problem, Aim(lambda J, peaks: peaks[0] + 0.1 * J[0], lambda J: [[J[0] / 2, J[1] / 16]]), ranges)
    assert derived.problem.limits[-1].upper == 0.0
    with pytest.raises(ValueError, match="aim may ask for a worse value of 'largest thrust squared'") as caught:
        valued(problem, Aim(lambda J, peaks: (J[1] - 5) ** 2 + J[0]), ranges)
    assert "\n" not in str(caught.value)
    # What is wrong with the problem itself is no fault of the preference.
    with pytest.raises(ValueError, match=r"objective 'speed'.*peak"):
        valued(with_peak("maximised").compile(), Aim(lambda J, peaks: J[2]), box([1.0, 0.2, 0.0], [3.0, 16.0, 1.0]))
    # The integral of an absolute value that may have to rise is no longer written as the least of what bounds it.
    problem = Problem("fuel")
    trip = problem.phase("trip", t0=0, tf=(1, 3))
    v, u = trip.state("v", bounds=(-2, 2), initial=0, final=1), trip.control("u", bounds=(-2, 2))
    trip.dynamics(v=u + 0 * v)
    problem.minimize("fuel", trip.integral(ca.fabs(u)))
    problem.minimize("time", trip.tf)
    compiled, ranges = problem.compile(), box([1.0, 1.0], [2.0, 3.0])
    assert valued(compiled, Aim(lambda J, peaks: J[0] ** 2 + J[1]), replace(ranges, lower=np.array([0.5, 0.5]))).problem.phases[0].sized
    assert not valued(compiled, Aim(lambda J, peaks: (J[0] - 1.5) ** 2 + J[1]), ranges).problem.phases[0].sized
