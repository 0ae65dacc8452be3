"""What a user sees who prints a thing: a line that names it, not all its numbers."""

from __future__ import annotations

import numpy as np
from cases import oscillator

from problems import load
from transcription import DFET, Trajectory
from transcription.inner import inner_solver
from transcription.nlp.scalarized import scalarize
from transcription.trajectories.simulate import simulate


def test_what_is_computed_is_shown_in_a_line():
    problem = oscillator()
    nlp = DFET(3, 2).transcribe(problem)
    found = inner_solver("propagate").solve(nlp, 0.5 * (nlp.lower + nlp.upper)[nlp.free][None].repeat(2, axis=0))
    trajectory = nlp.unpack(found.z[0])
    solved = scalarize(nlp, found.z[0], reference=np.zeros(2), weights=np.ones(2), max_iterations=1)
    shown = {
        problem: ["oscillator", "swing", "cost"],
        problem.compile(): ["oscillator", "swing", "cost"],
        problem.compile().phases[0]: ["swing", "x, y", "u, v"],
        nlp: ["oscillator", "DFET(elements=3, order=2)", f"{len(nlp.free)} free"],
        found: ["2 candidates: 2 converged"],
        trajectory["swing"]: ["swing", "13 nodes on 3 elements", "x, y, u, v"],
        trajectory["swing"].state: ["2 of degree 4 on 3 elements"],
        simulate(nlp.problem, trajectory): ["max_defect=", "violation=", "'cost': "],
        solved: [solved.status, "violation="],
    }
    for one, words in [*shown.items(), (trajectory, ["'swing' 0.25 to", "m=1.25"])]:
        text = repr(one)
        assert "\n" not in text and len(text) < 200 and text.startswith(type(one).__name__), text
        assert all(word in text for word in words), text
    assert isinstance(trajectory, Trajectory) and repr(load("goddard")).startswith("Problem('goddard'")
