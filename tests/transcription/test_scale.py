"""Sizes grow in proportion: entries, instructions and memory, which no clock has to tell."""

import tracemalloc

import numpy as np
import pytest

from problems import load
from runs.bench.growth import masses, ride
from transcription import parse
from transcription.nlp.derivatives import gradients, hessian
from transcription.numerics.batched import work
from transcription.phases.mesh import PhaseMesh
from transcription.shooting.control_law import ControlLaw
from transcription.shooting.step import StepMesh

SPARSE = ("dfet:{}x3", "radau:{}x3", "lobatto:{}x3", "multiple-shooting:{}", "multiple-shooting:{}:spline")
ALL = (*SPARSE, "shooting:{}", "shooting:{}:linear", "shooting:{}:spline")
ASKED = 1.1


def power(counts: list[int]) -> float:
    """Of the size, with which counts at three sizes, each twice the one before, grow; whatever does not grow is left out."""
    first, second, third = counts
    return float(np.log2((third - second) / (second - first)))


@pytest.mark.slow
@pytest.mark.parametrize("word", ALL)
def test_instructions_and_variables_grow_with_the_mesh(word):
    """From meshes on that are long enough for chains of steps, which are shorter to write than their operations."""
    first = 300 if word.startswith("shooting") else 150
    nlps = [parse(word.format(n)).transcribe(load("goddard")) for n in (first, 2 * first, 4 * first)]
    for count in (lambda nlp: len(nlp.variables), lambda nlp: work(nlp.functions), lambda nlp: nlp.reduced.instructions):
        assert power([count(nlp) for nlp in nlps]) < ASKED


@pytest.mark.parametrize("word", SPARSE[:-1])
def test_derivatives_grow_with_the_mesh(word):
    nlps = [parse(word.format(n)).transcribe(load("goddard")) for n in (50, 100, 200)]
    for entries in (lambda nlp: gradients(nlp).nnz_out(1), lambda nlp: hessian(nlp).nnz_out(0), lambda nlp: work(gradients(nlp))):
        assert power([entries(nlp) for nlp in nlps]) < ASKED


@pytest.mark.slow
@pytest.mark.parametrize("word", ["dfet:4x3", "radau:4x3", "multiple-shooting:6", "shooting:6"])
@pytest.mark.parametrize("build", [ride, masses])
def test_derivatives_grow_with_phases_and_variables(word, build):
    nlps = [parse(word).transcribe(build(n)) for n in (6, 12, 24)]
    for count in (lambda nlp: work(nlp.functions), lambda nlp: gradients(nlp).nnz_out(1), lambda nlp: hessian(nlp).nnz_out(0)):
        assert power([count(nlp) for nlp in nlps]) < ASKED


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["constant", "linear", "spline"])
def test_controls_by_their_values_are_sparse(kind):
    """The matrix from the values to the steps, and the memory that it takes to make it."""
    entries, peaks = [], []
    for nodes in (2000, 4000, 8000):
        places = np.linspace(0.0, 1.0, nodes)
        law = ControlLaw(kind, PhaseMesh.uniform(nodes - 1, 0))
        tracemalloc.start()
        entries.append(law._on_steps(StepMesh.of(nodes - 1, 1, places).places).nnz)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert power(entries) < ASKED and power(peaks) < ASKED
