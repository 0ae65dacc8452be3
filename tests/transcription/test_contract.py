"""What a method gets that fulfils the contract and nothing more: explicit Euler (`euler.py`), which no other file knows of."""

import json
import pickle

import numpy as np
import pytest
from cases import candidates, oscillator
from euler import Euler, EulerPhase

from macs import MACS, Front, payoff, sweep
from problems import Problem, load
from problems.cases.goddard import reference
from transcription import DFET, Collocation, from_dict, parse, word
from transcription.elements.phase import ElementsPhase
from transcription.inner import inner_solver
from transcription.phases.writer import PhaseWriter
from transcription.trajectories.simulate import simulate

METHOD = Euler(30)


def test_it_is_found_by_its_word_and_in_files():
    assert parse("euler:30") == METHOD and word(METHOD) == "euler:30" and repr(METHOD) == "Euler(elements=30)"
    meshed = METHOD.remeshed({"swing": ([0.0, 0.3, 1.0], 1)})
    assert from_dict(json.loads(json.dumps(meshed.to_dict()))) == meshed and word(meshed) is None
    with pytest.raises(ValueError, match=r"unknown transcription 'euler'; write it as euler:40 \(40 steps\)$"):
        parse("euler")
    with pytest.raises(ValueError, match="transcription 'euler:3x4': write it as euler:40"):
        parse("euler:3x4")
    with pytest.raises(ValueError, match="Euler: elements must be a whole number of at least 1, not 0"):
        parse("euler:0")
    with pytest.raises(ValueError, match="Euler: a mesh is given for phase 'swing'; the phases of 'goddard' are ascent"):
        meshed.transcribe(load("goddard"))


def test_it_converges_with_order_1_to_what_an_integrator_makes_of_its_controls():
    defects = []
    for elements in (20, 40, 80):
        nlp = Euler(elements).transcribe(oscillator())
        middle = nlp.lower[nlp.free] + 0.5 * nlp.span[nlp.free]
        (z,) = inner_solver("propagate").solve(nlp, middle[None]).z
        assert nlp.evaluate(z[None])[1] < 1e-13
        defects.append(simulate(nlp.problem, nlp.unpack(z)).max_defect)
    assert np.log2(np.divide(defects[:-1], defects[1:])) == pytest.approx(1.0, abs=0.1)


def test_an_nlp_is_shared_by_all_that_use_one_problem():
    problem = load("goddard").compile()
    nlp = METHOD.nlp(problem)
    assert METHOD.nlp(problem) is nlp and Euler(30).nlp(problem) is nlp and Euler(31).nlp(problem) is not nlp
    copied = pickle.loads(pickle.dumps(problem))
    assert not copied.derived and copied.fingerprint == problem.fingerprint and copied.compile() is copied


@pytest.mark.slow
def test_gradient_tools_searches_and_mesh_refinement_work_on_it():
    problem, truth = load("goddard"), reference(2001)
    assert payoff(problem, METHOD, starts=1).objectives == pytest.approx(truth[[0, -1]], rel=1e-3, abs=1e-3)
    searched = MACS(mesh="fixed").solve(problem, METHOD, evaluations=200, seed=1)
    assert len(searched) == 10 and searched.violation.max() < 1e-6
    coarse = sweep(problem, METHOD, points=3, starts=1)
    assert (coarse.status == "converged").all() and coarse[1].simulate().max_defect > 1e-2
    refined = Front.of(coarse[1].alone()).refine_mesh(tolerance=1e-2, limit=8)
    assert refined[0].simulate().max_defect < 1e-2
    assert len(refined[0].trajectory["ascent"].time) > len(coarse[1].trajectory["ascent"].time)


def jump() -> Problem:
    """Two phases, a parameter, an imposed final value that enters the dynamics."""
    problem = Problem("jump")
    drag = problem.parameter("drag", bounds=(0.1, 0.3))
    first, second = problem.phase("first", t0=0.0, tf=(0.5, 2.0)), problem.phase("second", t0=(0.5, 2.0), tf=(2.0, 5.0))
    for phase in (first, second):
        x = phase.state("x", bounds=(-5, 5), initial=0.0 if phase is first else None, final=None if phase is first else 1.0)
        phase.control("u", bounds=(-2, 2))
        phase.dynamics(x=phase["u"] - drag * x**3)
    problem.link(first, second)
    problem.minimize("effort", second.integral(second["u"] ** 2))
    return problem


@pytest.mark.parametrize(
    "method",
    [
        DFET(3, 2),
        DFET(2, 3, basis="bernstein"),
        Collocation(3, 3),
        Collocation(2, 3, control="bernstein", control_order=1),
        *(Collocation(2, 3, points=points) for points in ("gauss", "lobatto", "chebyshev")),
    ],
)
def test_default_propagation_and_derivatives_are_those_of_the_method_itself(method, monkeypatch):
    problem = jump().compile()
    own = method.transcribe(problem)
    Z = own.propagate(own.first_guess(candidates(own, 3)))
    rows = np.arange(len(own.reduced.scale))
    found = own.reduced.propagate(Z)
    derivatives = own.reduced.derivatives(found, rows)
    for name in ("propagate", "sensitivity"):
        monkeypatch.setattr(ElementsPhase, name, getattr(PhaseWriter, name))
    monkeypatch.setattr(ElementsPhase, "compilable", False)
    plain = method.transcribe(problem)
    again = plain.reduced.propagate(plain.first_guess(Z[:, plain.free]))
    assert np.abs(again.Z - Z).max() < 1e-11 and np.abs(again.values - found.values).max() < 1e-11
    assert plain.reduced.derivatives(again, rows) == pytest.approx(derivatives, rel=1e-8, abs=1e-10)


def test_rows_that_do_not_determine_the_states_are_refused(monkeypatch):
    nodes = EulerPhase.state_nodes
    monkeypatch.setattr(EulerPhase, "state_nodes", lambda self: tuple(part[1:] for part in nodes(self)))
    with pytest.raises(ValueError, match="phase 'first': 30 rows of dynamics do not determine 29 states"):
        METHOD.transcribe(jump()).propagate(np.zeros((1, 1)))
