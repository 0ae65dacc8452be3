"""Collocation against optima that the literature prints for the same method, and against the other transcriptions."""

from __future__ import annotations

import pytest

from macs import Front, optimize
from problems import load
from problems.cases.standard import published
from runs.bench.published import WORDS
from transcription import Collocation, parse

QUICK = ("breakwell", "linear_tangent", "van_der_pol")
"""One of each kind that takes little: a path limit, a free time, a bound; for one with none of these, see the tests of the benchmark."""


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_all_transcriptions_have_the_same_optimum(name):
    """Each from the problem's own guess, on the mesh it begins on in `macs bench methods`; refined, they agree to 1e-3 or better."""
    problem, record = load(f"standard/{name}"), published(name)[0]
    for word in WORDS:
        method = parse(word)
        point = optimize(problem, method, verify=None, starts=1)
        assert point.status == "converged"
        (point,) = point.alone().refine_mesh(tolerance=1e-5)
        assert record.error(point.objectives[record.objective]) == pytest.approx(0.0, abs=3e-4), word


RADAU = {
    "delta_iii": (7529.7123, 0.01, "GPOPS (Rao et al., ACM TOMS 37(2), 2010): 7529.712412 kg; YAPSS, Legendre-Gauss-Radau: 7529.712287"),
    "tumour": (7571.67158, 0.02, "CGPOPS (Agamawi and Rao, ACM TOMS 46(3), 2020), by Radau collocation: 7571.67158"),
    "dynamic_soaring": (0.06358656, 1e-6, "YAPSS 0.2.3, with the data of GPOPS-II (Patterson and Rao, ACM TOMS 41(1), 2014)"),
    "hypersensitive": (1.330806904943, 1e-6, "closed form; the first example of GPOPS-II (Patterson and Rao 2014), which draws it"),
}
"""Optima of programs that collocate at Radau points, how near ours have to be, and where they are printed."""


@pytest.mark.slow
@pytest.mark.parametrize("name", RADAU)
def test_radau_reproduces_published_optima_of_radau_collocation(name):
    value, within, _ = RADAU[name]
    record = published(name)[0]
    mesh = Collocation(5, 5) if name == "delta_iii" else Collocation(20, 4)
    found = Front.of(optimize(load(f"standard/{name}"), mesh, verify=None, starts=1).alone())
    (point,) = found.refine_mesh(tolerance=1e-6).verify(1e-3)
    assert point.verified and point.objectives[record.objective] == pytest.approx(value, abs=within)
    assert record.met(point.objectives[record.objective])
