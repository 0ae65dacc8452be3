"""Compiled libraries and FMUs: what they give agrees with the same rates written in CasADi."""

import os
import pickle
import shutil
import subprocess
import sys
import time
import warnings
import zipfile

import casadi as ca
import numpy as np
import pytest
from test_externals import ascent

from macs import optimize, sweep
from problems import Fmu, Problem, external
from problems.layers import mapped
from transcription import DFET

COMPILER = shutil.which("gcc") or shutil.which("cc")
needs_a_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

# A cart with drag, v' = a u - drag v^2 + t / 20, for both versions of the interface. It fails beyond x = 1e3.
SOURCE = r"""
#include <stdlib.h>
#include <string.h>
typedef unsigned int ref; typedef double *numbers; typedef const double *given;
enum {TIME, X, V, U, A, DRAG, DX, DV, POWER, COUNT};
static void *begin(void) { double *m = calloc(COUNT, 8); m[A] = 1; m[DRAG] = 0.1; return m; }
static int get(double *m, const ref r[], size_t n, numbers v) {
    m[DX] = m[V]; m[DV] = m[A] * m[U] - m[DRAG] * m[V] * m[V] + 0.05 * m[TIME]; m[POWER] = m[U] * m[V];
    for (size_t i = 0; i < n; i++) v[i] = m[r[i]];
    return m[X] > 1e3 ? 3 : 0;
}
static int set(double *m, const ref r[], size_t n, given v) { for (size_t i = 0; i < n; i++) m[r[i]] = v[i]; return 0; }
static int along(double *m, const ref z[], size_t n, const ref v[], size_t k, given d, numbers found) {
    double e[COUNT] = {0};
    for (size_t i = 0; i < k; i++) { if (v[i] == TIME) abort(); e[v[i]] = d[i]; }
    e[DX] = e[V]; e[DV] = SIGN (m[A] * e[U] + e[A] * m[U] - 2 * m[DRAG] * m[V] * e[V]); e[POWER] = e[U] * m[V] + m[U] * e[V];
    for (size_t i = 0; i < n; i++) found[i] = e[z[i]];
    return 0;
}
#define NONE(name) int name() { return 0; }
void *fmi2Instantiate() { return begin(); } void fmi2FreeInstance(void *m) { free(m); }
void *fmi3InstantiateModelExchange() { return begin(); } void fmi3FreeInstance(void *m) { free(m); }
int fmi2SetTime(double *m, double t) { m[TIME] = t; return 0; } int fmi3SetTime(double *m, double t) { m[TIME] = t; return 0; }
int fmi2GetReal(double *m, const ref r[], size_t n, numbers v) { return get(m, r, n, v); }
int fmi2SetReal(double *m, const ref r[], size_t n, given v) { return set(m, r, n, v); }
int fmi3GetFloat64(double *m, const ref r[], size_t n, numbers v, size_t k) { return get(m, r, n, v); }
int fmi3SetFloat64(double *m, const ref r[], size_t n, given v, size_t k) { return set(m, r, n, v); }
int fmi2GetDirectionalDerivative(double *m, const ref z[], size_t n, const ref v[], size_t k, given d, numbers s)
    { return along(m, z, n, v, k, d, s); }
int fmi3GetDirectionalDerivative(double *m, const ref z[], size_t n, const ref v[], size_t k, given d, size_t a, numbers s, size_t b)
    { return along(m, z, n, v, k, d, s); }
#define BOTH(name) NONE(fmi2##name) NONE(fmi3##name)
BOTH(Reset) BOTH(EnterInitializationMode) BOTH(ExitInitializationMode) BOTH(EnterContinuousTimeMode) BOTH(GetBoolean) BOTH(SetBoolean)
BOTH(GetString) BOTH(SetString) BOTH(GetDerivatives) NONE(fmi2SetupExperiment) NONE(fmi2GetInteger) NONE(fmi2SetInteger)
NONE(fmi2NewDiscreteStates) NONE(fmi3GetInt32) NONE(fmi3SetInt32) NONE(fmi3GetContinuousStateDerivatives)
int fmi3UpdateDiscreteStates(void *m, char *a, char *b, char *c, char *d, char *e, double *t) { *a = *b = *c = *d = *e = 0; return 0; }
"""

# name, reference, attributes of the variable, attributes of its value
VARIABLES = [
    ("time", 0, 'causality="independent" variability="continuous"', ""),
    ("x", 1, 'causality="local" variability="continuous" initial="exact"', 'start="0" declaredType="Length"'),
    ("cart.v", 2, 'causality="local" variability="continuous" initial="exact"', 'start="0" unit="m/s"'),
    ("u", 3, 'causality="input" variability="continuous"', 'start="0" min="0" max="2"'),
    ("a", 4, 'causality="parameter" variability="tunable" initial="exact"', 'start="1"'),
    ("drag", 5, 'causality="parameter" variability="fixed" initial="exact"', 'start="0.1" unit="1/m"'),
    ("der(x)", 6, 'causality="local" variability="continuous"', 'derivative="{x}"'),
    ("der(v)", 7, 'causality="local" variability="continuous"', 'derivative="{v}"'),
    ("power", 8, 'causality="output" variability="continuous"', ""),
]


def description(version, model="ModelExchange"):
    """The description of the cart. Its list of dependencies is wrong, as in some files of tools."""
    lines, two = [], version == 2
    for name, number, of_variable, of_value in VARIABLES:
        of_value = of_value.format(**({"x": 2, "v": 3} if two else {"x": 1, "v": 2}))
        begin, inside = f'name="{name}" valueReference="{number}" {of_variable}', f"<Real {of_value}/>"
        lines.append(f"<ScalarVariable {begin}>{inside}</ScalarVariable>" if two else f"<Float64 {begin} {of_value}/>")
    kind = '<SimpleType name="Length"><Real unit="m" min="0" max="5"/></SimpleType>'
    of_type = kind if two else '<Float64Type name="Length" unit="m" min="0" max="5"/>'
    known = '<Unknown index="{0}" dependencies=""/>'
    structure = (
        f"<Outputs>{known.format(9)}</Outputs><Derivatives>{known.format(7)}{known.format(8)}</Derivatives>"
        if two
        else '<Output valueReference="8"/>' + "".join(f'<ContinuousStateDerivative valueReference="{k}" dependencies=""/>' for k in (6, 7))
    )
    token, more = ("guid", "") if two else ("instantiationToken", "s")
    return (
        f'<fmiModelDescription fmiVersion="{version}.0" modelName="cart" {token}="1"><{model} modelIdentifier="cart" '
        f'providesDirectionalDerivative{more}="true"/><TypeDefinitions>{of_type}</TypeDefinitions><ModelVariables>{"".join(lines)}'
        f"</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def compiled(source, to):
    subprocess.run([COMPILER, "-O1", "-w", "-shared", "-fPIC", "-o", to, source, "-lm"], check=True)
    return to


def write_fmu(folder, version, sign="", binaries=None, **settings):
    """A file cart.fmu."""
    source, path = folder / "cart.c", folder / f"cart{version}.fmu"
    source.write_text(SOURCE.replace("SIGN", sign))
    platform = os.uname().machine
    place = binaries or ("linux64" if version == 2 else f"{platform}-linux")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(version, **settings))
        archive.write(compiled(source, folder / "cart.so"), f"binaries/{place}/cart.so")
    return path


def sprint(model=None, **settings):
    problem = Problem("sprint")
    run = problem.phase("run", t0=0.0, tf=(1.0, 9.0))
    if model is None:
        _, v = run.state("x", bounds=(0, 5), initial=0, final=5), run.state("cart.v", bounds=(0, 3), initial=0)
        u = run.control("u", bounds=(0, 2))
        run.dynamics(**{"x": v, "cart.v": u - 0.1 * v**2 + 0.05 * run.time})
        power = u * v
    else:
        power = model.declare(run, bounds={"cart.v": (0, 3)}, final={"x": 5}, outputs=["power"], **settings)["power"]
    run.path("power", power, upper=3.0)
    problem.minimize("time", run.tf)
    problem.minimize("effort", run.integral(run["u"] ** 2))
    return problem


@needs_a_compiler
@pytest.mark.parametrize("version", [2, 3])
def test_the_front_with_an_fmu_is_that_of_the_same_rates_in_casadi(version, tmp_path):
    model = Fmu(write_fmu(tmp_path, version))
    assert model.variables["x"].unit == "m" and model.variables["x"].bounds == (0.0, 5.0)
    assert "parameter  drag" in str(model) and "fixed" in str(model)
    known, found = (sweep(one, DFET(3, 4), points=3, starts=1) for one in (sprint(), sprint(model)))
    assert found.objectives == pytest.approx(known.objectives, rel=1e-6)
    assert found.verified.tolist() == known.verified.tolist() and found.verified.any()
    assert found[0].trajectory["run"]["x"][0] == 0.0  # where the FMU starts


@needs_a_compiler
def test_parameters_of_an_fmu_take_numbers_and_tunable_ones_expressions_with_derivatives(tmp_path):
    problem = Problem("push")
    run = problem.phase("run", t0=0.0, tf=1.0)
    a = problem.parameter("push", bounds=(0.5, 2.0))
    Fmu(write_fmu(tmp_path, 3)).declare(run, bounds={"cart.v": (0, 3)}, values={"a": 2.0 * a, "drag": 0.5})
    problem.minimize("end", run.final(run["x"]))
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # as where derivatives are not those by differences
        rates = problem.compile().phases[0].dynamics
    point = [0.0, 1.0], 1.5, 0.0, [0.0, 1.0, 0.8]
    assert np.array(rates(*point)).ravel() == pytest.approx([1.0, 1.6 * 1.5 - 0.5])
    slopes = ca.Function("J", rates.mx_in(), [ca.jacobian(rates(*rates.mx_in()), ca.veccat(*rates.mx_in()))])(*point)
    assert np.array(slopes)[1] == pytest.approx([0.0, -1.0, 1.6, 0.05, 0.0, 0.0, 3.0])


@needs_a_compiler
def test_wrong_derivatives_of_an_fmu_are_noticed_and_failures_are_no_numbers(tmp_path):
    with pytest.warns(UserWarning, match="the derivative of 'cart.v' by 'cart.v' is .* as given, and -.* by differences, which"):
        compiled = sprint(Fmu(write_fmu(tmp_path, 2, sign="-"))).compile()
    known = sprint().compile()
    X = np.random.default_rng(0).random((2, 3))
    inputs = X, X[:1], 0.0, np.array([0.0, 1.0])
    assert np.array(compiled.phases[0].dynamics(*inputs)) == pytest.approx(np.array(known.phases[0].dynamics(*inputs)))
    found = np.array(mapped(compiled.phases[0].dynamics, 3)(np.array([[1.0, 2e3, 1.0], [1.0, 1.0, 2.0]]), 1.0, 0.0, np.array([0.0, 1.0])))
    assert found[1] == pytest.approx([0.9, np.nan, 0.6], nan_ok=True)


@needs_a_compiler
@pytest.mark.parametrize(
    ("settings", "given", "message"),
    [
        ({"model": "CoSimulation"}, {}, "is for co-simulation only"),
        ({"binaries": "win64"}, {"bounds": {"cart.v": (0, 3)}}, "cannot be loaded on this machine, it has binaries for win64"),
        ({}, {}, r"no bounds of cart.v: give bounds=\{'cart.v': \(lower, upper\)\}"),
        ({}, {"bounds": {"w": (0, 1)}}, "bounds of 'w'; there are x, cart.v, u"),
        ({}, {"outputs": ["force"]}, "outputs of 'force'"),
        ({}, {"values": {"drag": ca.MX.sym("d")}, "bounds": {"cart.v": (0, 3)}}, "'drag' is a fixed parameter, which takes a number"),
    ],
)
def test_what_an_fmu_does_not_have_is_said_by_its_names(settings, given, message, tmp_path):
    phase = Problem("p").phase("run", t0=0.0, tf=1.0)
    with pytest.raises(ValueError, match=message):
        Fmu(write_fmu(tmp_path, 2, **settings)).declare(phase, **given)


def library(folder, kind):
    """A library of rates with derivatives of a kind, made by CasADi."""
    x, u, t = ca.SX.sym("x", 4), ca.SX.sym("u"), ca.SX.sym("t")
    rates = ca.Function(
        "rates", [t, x, u], [ca.vertcat(x[1], 4e-3 * ca.cos(u) + 0.0 * t, x[3], 4e-3 * ca.sin(u) - 1.6e-3)], ["t", "x", "u"], ["r"]
    )
    generator = ca.CodeGenerator("model.c")
    for one in {"none": [], "jacobian": [rates.jacobian()], "forward": [rates.forward(1)], "reverse": [rates.reverse(1)]}[kind] + [rates]:
        generator.add(one)
    generator.generate(f"{folder}/")
    return f"{compiled(folder / 'model.c', folder / 'model.so')}:rates"


@needs_a_compiler
@pytest.mark.parametrize("kind", ["none", "jacobian", "forward", "reverse"])
def test_the_front_with_a_library_is_that_of_the_same_rates_in_casadi(kind, tmp_path):
    path = library(tmp_path, kind)
    known, found = (sweep(one, DFET(2, 4), points=2, starts=1) for one in (ascent(), ascent(path)))
    assert found.objectives == pytest.approx(known.objectives, rel=1e-6, abs=1e-6)
    made = external(path, states=["x", "vx", "y", "vy"], controls=["u"])
    pattern = ca.jacobian(made, ca.vertcat(*ca.symvar(made))).nnz()
    assert pattern == {"none": 24, "jacobian": 4}.get(kind, pattern)


@needs_a_compiler
@pytest.mark.slow
def test_a_library_with_derivatives_takes_at_most_three_times_the_cpu_time(tmp_path):
    def seconds(rates):
        sweep(ascent(rates), DFET(4, 6), points=2, starts=1)  # what the first call alone takes
        begin = time.process_time()
        sweep(ascent(rates), DFET(4, 6), points=5, starts=3)
        return time.process_time() - begin

    assert seconds(library(tmp_path, "jacobian")) <= 3.0 * seconds(None)


@needs_a_compiler
def test_what_a_library_does_not_have_is_said_by_the_users_names(tmp_path):
    path, names = library(tmp_path, "none"), {"states": ["x", "y"], "controls": ["u"]}
    (tmp_path / "text.so").write_text("no library")
    for address, message in (
        (path, r"takes 6 numbers, t \(1\), x \(4\), u \(1\); states, controls and parameters are 3, x, y, u"),
        (path.replace("rates", "forces"), "has no function 'forces' of CasADi's C interface"),
        (path.replace("model", "other"), "there is no file .*other.so"),
        (path.replace("model", "text"), "the library cannot be loaded: .*text.so"),
        ("rates", "such as 'model.so:rates'"),
    ):
        with pytest.raises(ValueError, match=message):
            external(address, **names)


@needs_a_compiler
def test_both_go_to_other_processes_which_leave_no_folder_behind(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        both = [sprint(Fmu(write_fmu(tmp_path, 3))).compile(), ascent(library(tmp_path, "jacobian")).compile()]
    text = "import pickle, sys; print(*[p.phases[0].dynamics(0.5, 0.5, 0, [0, 1]) for p in pickle.load(sys.stdin.buffer)])"
    (tmp_path / "empty").mkdir()
    environment = os.environ | {"TMPDIR": str(tmp_path / "empty")}
    found = subprocess.run([sys.executable, "-c", text], input=pickle.dumps(both), capture_output=True, env=environment, check=True).stdout
    assert found.decode().split()[:2] == ["[0.5,", "0.475]"] and "0.00351033" in found.decode()
    assert list((tmp_path / "empty").iterdir()) == []


@needs_a_compiler
@pytest.mark.slow
def test_an_fmu_gives_the_same_with_workers(tmp_path):
    problem = sprint(Fmu(write_fmu(tmp_path, 2)))
    alone, together = (sweep(problem, DFET(3, 4), points=3, starts=2, workers=workers) for workers in (1, 2))
    assert np.array_equal(alone.objectives, together.objectives)
    assert optimize(problem, DFET(3, 4), starts=1).simulate().max_defect < 1e-6
