"""The transcription of a problem for which none is given: its own default, or one on a mesh that is found."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from problems.compiled import CompiledProblem
from problems.problem import Problem
from transcription.base import Transcription
from transcription.catalogue import stated
from transcription.elements.dfet import DFET
from transcription.meshed import Meshed
from transcription.meshes.verdict import Wanted
from transcription.phases.mesh import PhaseMesh

from ..evaluation.evaluator import CONVERGED, Counts
from ..fronts.builders import certified, from_vectors
from ..fronts.points import Points
from ..fronts.verified import verified
from ..gradients.ends import lexicographic_ends
from ..gradients.multistart import MultistartSolver, MultistartStopping, guessed_start
from ..gradients.scalarised import GradientSolves
from .mesh_loop import differentiable
from .mesh_refinement import FrontRefinement

COARSE = DFET(8, 3, basis="bernstein")
"""The first mesh of a problem that names none."""
PART = 1.0
"""What the ends of a front may miss on the mesh of a search, as a multiple of what points may: these get meshes of their own."""
MESHES = 8
"""Most meshes of one end, beside the coarse one."""
MOST = 40
"""Most elements of a phase: a search evaluates its mesh thousands of times."""
NEAR = 0.25
"""An edge is left out if the element is then longer than the shortest there by at most this part."""


def default_transcription(problem: Problem | CompiledProblem) -> Transcription:
    """The problem's own default, or a coarse mesh."""
    own = problem.default_transcription if isinstance(problem, Problem) else None
    return COARSE if own is None else stated(own)


@dataclass(frozen=True)
class Chosen:
    """Where a problem is solved for which no transcription is given."""

    search: Transcription  # for the candidates of a search: cheap
    fine: Meshed | None  # A finer mesh, where one is needed for points that a simulation confirms
    counts: Counts  # what it cost to find out
    ends: Points | None = None  # the optima of single objectives on the coarse mesh, from which that was found out
    refined: Points | None = None  # the same on meshes of their own
    stopping: Mapping[int, MultistartStopping] = field(
        default_factory=dict
    )  # what the starts for each single objective have found on the coarse mesh


def search_transcription(
    problem: Problem | CompiledProblem,
    compiled: CompiledProblem,
    verify: float,
    tolerance: float,
    show: Callable[[str], None] = lambda words: None,
) -> Chosen:
    """The problem's own default transcription, or what `found_mesh` finds."""
    if isinstance(problem, Problem) and problem.default_transcription is not None:
        return Chosen(stated(problem.default_transcription), None, Counts())
    return found_mesh(compiled, verify, tolerance, show)


def found_mesh(problem: CompiledProblem, verify: float, tolerance: float, show: Callable[[str], None] = lambda words: None) -> Chosen:
    """DFET on a coarse mesh for a search, and on a mesh for all points of its front.

    Each objective is optimised, and for its best value the others, from the problem's guess and random starts, on a coarse mesh and then on
    finer ones, until a simulation agrees and a finer mesh changes nothing. The mesh has the elements of all these.
    """
    if not differentiable(problem):
        return Chosen(COARSE, None, Counts())
    nlp = COARSE.nlp(problem)
    solves, rng = GradientSolves(tolerance), np.random.default_rng(0)
    solver = MultistartSolver(nlp, guessed_start(nlp), None, rng, solves)
    show("ends of the front on a coarse mesh")
    solved = lexicographic_ends(solver)
    own = [k for k, one in enumerate(solved) if one.status == CONVERGED]
    Z = np.array([solved[k].z for k in own]).reshape(-1, len(nlp.variables))
    ends = from_vectors(nlp, Z, {}, {"tolerance": tolerance}, sort=False, **certified(nlp, Z, None))
    limits = PART * verify
    job = FrontRefinement(ends, Wanted(limits, feasible=limits, leaving=limits, objectives=limits), MESHES, knots=False)
    job.go(show)
    counts = solves.counts.joined(job.solves.counts)
    found = [one.best.method for one in job.found.values()]
    fine = _common(found, problem) if found and not _enough(ends, own, job, limits) else COARSE
    if not len(ends):
        return Chosen(COARSE, None, counts)
    refined = job.points(0.0, "").replace(notes=[""] * len(ends))
    return Chosen(COARSE, None if fine == COARSE else fine, counts, ends, refined, solver.stopping)


def _enough(ends: Points, own: Sequence[int], job: FrontRefinement, limits: float) -> bool:
    """Whether a simulation confirms the ends on the coarse mesh, and finer ones changed nothing in the objectives that are their own."""
    moved = [abs(found.best.F[own[i]] - ends.F[i, own[i]]) / job.units[own[i]] for i, found in job.found.items()]
    return bool(verified(ends, limits).verified.all()) and max(moved, default=0.0) <= limits


def _common(methods: Sequence[Meshed], problem: CompiledProblem) -> Meshed:
    """DFET on one mesh that has the elements and degrees of several."""
    meshes = {phase.name: _together([method.mesh_of(phase.name) for method in methods]) for phase in problem.phases}
    basis = "lobatto" if all(getattr(method, "basis", "") == "lobatto" for method in methods) else COARSE.basis
    return DFET(COARSE.elements, COARSE.order, basis=basis, mesh=meshes)


def _together(meshes: Sequence[PhaseMesh]) -> PhaseMesh:
    """A mesh with the edges of several, without those that divide what no single mesh divides as finely. Its degree is one above theirs:
    points between the ends may be harder than these."""
    edges = sorted({edge for mesh in meshes for edge in mesh.edges})
    while len(edges) > 2:
        joined = np.array(edges[2:]) - np.array(edges[:-2])
        # How long the element without an edge would be, in those that the meshes have there.
        excess = joined / np.array([min(_length_at(mesh, edge) for mesh in meshes) for edge in edges[1:-1]])
        k = int(np.argmin(excess))
        if excess[k] > 1.0 + NEAR and len(edges) - 1 <= MOST:
            break
        del edges[k + 1]
    orders = [mesh.control_order for mesh in meshes]
    controls = None if None in orders else max(order for order in orders if order is not None)
    return PhaseMesh(tuple(edges), 1 + max(mesh.order for mesh in meshes), controls)


def _length_at(mesh: PhaseMesh, place: float) -> float:
    """The length of the shortest element of a mesh that has a place in it or at its end."""
    edges = np.array(mesh.edges)
    touching = (edges[:-1] <= place) & (place <= edges[1:])
    return float(np.diff(edges)[touching].min())
