"""Collocation against optima that the literature prints for the same method, and against the other transcriptions."""

from __future__ import annotations

import pytest

from macs import Front, optimize
from problems import load
from problems.cases.standard import published
from runs.bench.methods import METHODS
from transcription import Collocation, Meshed, parse

QUICK = ("breakwell", "linear_tangent", "van_der_pol", "zermelo")
"""One of each kind that takes little: a path limit, a free time, a bound, and none of these."""


@pytest.mark.parametrize("name", QUICK)
def test_all_transcriptions_have_the_same_optimum(name):
    """Each from the problem's own guess, on the mesh it begins on in `macs bench methods`; refined, they agree to 1e-3 or better."""
    problem, record = load(f"standard/{name}"), published(name)[0]
    for word in METHODS:
        method = parse(word)
        point = optimize(problem, method, verify=None)
        assert point.status == "converged"
        if isinstance(method, Meshed):
            (point,) = point.alone().refine_mesh(tolerance=1e-5)
        assert record.error(point.objectives[record.objective]) == pytest.approx(0.0, abs=3e-4), word


# What GPOPS-II found, by Radau collocation on meshes of its own, as its papers print it.
GPOPS = {
    "hypersensitive": (1.330806, 2e-5, "closed form of the cost; Patterson and Rao, ACM TOMS 41(1), 2014, section 5.1, draw this solution"),
    "delta_iii": (7529.7, 0.1, "Rao et al., GPOPS, ACM TOMS 37(2), 2010, and GPOPS-II's manual: the mass in the last orbit, kg"),
    "tumour": (7571.7, 0.1, "Patterson and Rao, ACM TOMS 41(1), 2014, section 5.3, after Ledzewicz and Schaettler 2008"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", GPOPS)
def test_radau_reproduces_published_optima_of_radau_collocation(name):
    value, within, _ = GPOPS[name]
    record = published(name)[0]
    mesh = {"delta_iii": Collocation(5, 5), "hypersensitive": Collocation(30, 5), "tumour": Collocation(20, 4)}[name]
    found = Front.of(optimize(load(f"standard/{name}"), mesh, verify=None).alone())
    (point,) = found.refine_mesh(tolerance=1e-6).verify(1e-3)
    assert point.verified and point.objectives[record.objective] == pytest.approx(value, abs=within)
    assert record.met(point.objectives[record.objective])
