import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from carts import MESH, cart
from synthetic_fronts import flights, marked

import macs
from macs import Front, sweep
from problems import names
from runs.batch import file as studyfile
from runs.cli import main
from runs.cli.commands import make_solver

MACS = [sys.executable, "-m", "runs.cli"]
SCRIPT = """
from misbehaving import glide
from problems import Problem

def build(speed=3.0):
    problem = glide(speed)
    problem.default_transcription = "dfet:2x2:bernstein"
    problem.default_evaluations = 40
    return problem

def lagging():
    problem = Problem("lagging")
    phase = problem.phase("leg", t0=0.0, tf=20.0)
    x = phase.state("x", bounds=(0, 20), initial=0)
    u = phase.control("u", bounds=(0, 10))
    phase.dynamics(x=5.0 * (u - x))
    problem.maximize("end", phase.final(x))
    return problem

def rough():
    problem = Problem("rough")
    phase = problem.phase("leg", t0=0.0, tf=2.0)
    x = phase.state("x", bounds=(0, 10), initial=0)
    u = phase.control("u", bounds=(0, 5))
    phase.dynamics(x=u - 3.0 * x)
    problem.maximize("end", phase.final(x))
    problem.minimize("effort", phase.integral(u**2))
    problem.default_transcription = "dfet:1x2:bernstein"
    problem.default_evaluations = 40
    return problem

def forgiving():
    problem = rough()
    problem.default_verify = 0.5
    return problem

def impossible():
    problem = build()
    problem.constraint("twice", problem.phases["leg"].tf, lower=100.0)
    return problem

def broken():
    return undefined_name

def nothing():
    return 7
"""
STUDY = 'problems = "glide.py:build"\nsolvers = "macs"\nruns = 1\nseed = 1\n'


@pytest.fixture(autouse=True)
def files(here):
    Path("glide.py").write_text(SCRIPT, encoding="utf-8")
    Path("gliders.toml").write_text(STUDY, encoding="utf-8")
    Path("text.nc").write_text("no front", encoding="utf-8")
    Path("empty").mkdir()


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("saved")
    call = [*MACS, "solve", "goddard", "--evaluations", "60", "--seed", "1", "--out", "front.nc", "--plot", "front.png"]
    return folder, subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=120)


def test_help_is_instant():
    code = (
        "import sys\nfrom runs.cli import main\n"
        "for call in (['--help'], ['solve', '--help'], ['bench', '--help'], ['--version']):\n"
        "    try: main(call)\n    except SystemExit as end: assert end.code == 0\n"
        "heavy = ('casadi', 'matplotlib', 'xarray', 'numpy', 'scipy', 'rich', 'pandas', 'h5netcdf', 'pymoo')\n"
        "sys.exit(str([m for m in heavy if m in sys.modules]) if any(m in sys.modules for m in heavy) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    for word in ("list", "solve", "show", "verify", "--transcription", "--no-refine", "exit codes"):
        assert word in done.stdout


def test_list_has_a_line_for_every_case_and_every_study(capsys):
    assert main(["list"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [words[0] for words in lines] == [*names(), *studyfile.names()] and all(len(words) > 3 for words in lines)


def test_solve_prints_defects_and_leaves_a_front_and_a_picture(saved):
    folder, done = saved
    assert done.returncode == 0, done.stderr
    front = Front.load(folder / "front.nc")
    assert "verified" in done.stdout and "flight time" in done.stdout and "km/s" in done.stdout
    rows = [line for line in done.stdout.splitlines() if re.match(r"\d+  ", line)]
    assert len(rows) == len(front) > 0 and all(re.search(r"\d +verified$", row) for row in rows) and front.verified.all()
    assert "front saved in front.nc" in done.stdout and "picture in front.png" in done.stdout
    assert front.stats["seed"] == 1 and front.stats["evaluations"] == 60
    assert {path.name for path in folder.iterdir()} == {"front.nc", "front.png"}
    assert "60 / 60 evaluations" in done.stderr


@pytest.mark.slow
def test_a_problem_of_ones_own_needs_no_option_and_overwrites_nothing(capsys, refused):
    assert main(["solve", "glide.py:build", "--no-refine"]) == 0
    assert main(["solve", "glide.py:build", "--no-refine", "--evaluations", "40"]) == 0
    assert "front saved in glide-2.nc" in capsys.readouterr().out
    assert Front.load("glide.nc").stats["stopped"] == "done" and Front.load("glide-2.nc").stats["evaluations"] == 40
    assert "made by the code at" in refused("verify", "glide.nc")
    assert main(["verify", "glide.nc", "--trust"]) == 0
    assert main(["verify", "glide.nc", "--problem", "glide.py:build"]) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "exceeded"), [("shooting:6:linear", ""), ("radau:2x3", ""), ("multiple-shooting:4x2:kutta3:spline:3", "bounds of leg.u")]
)
def test_other_transcriptions_are_solved_shown_and_verified(capsys, method, exceeded):
    """A spline leaves its bounds between nodes."""
    inner = ["--inner", "propagate"] if "shooting" in method else []
    call = ["solve", "glide.py:build", "--transcription", method, *inner, "--mesh", "fixed", "--seed", "1"]
    call += ["--evaluations", "40"]
    assert main([*call, "--out", "shot.nc"]) == 0
    assert main(["show", "shot.nc", "--point", "0"]) == 0 and ("Shooting(" if inner else "Collocation(") in capsys.readouterr().out
    assert main(["verify", "shot.nc", "--trust", "--tolerance", "1e-6"]) == bool(exceeded)
    out = capsys.readouterr().out
    assert f"simulated, it violates {exceeded}" in out if exceeded else "FAILS" not in out


@pytest.mark.slow
def test_points_that_miss_when_simulated_are_told_by_solve_by_show_and_by_verify(capsys):
    """That is no failure of `solve`, but `verify` says no."""
    call = ["solve", "glide.py:rough", "--inner", "projection", "--mesh", "fixed", "--seed", "1", "--evaluations", "40"]
    assert main([*call, "--out", "rough.nc"]) == 0
    out = capsys.readouterr().out
    assert "Not verified: simulated, these differ by more than 0.001." in out and "simulated, its states differ by" in out
    assert "See `macs verify rough.nc --problem glide.py:rough`." in out
    front = Front.load("rough.nc")
    assert 0 < front.verified.sum() < len(front) and front.stats["verify"] == 1e-3
    assert f"{front.verified.sum()} of {len(front)} points are verified." in out
    index = int((~front.verified).argmax())
    assert main(["show", "rough.nc", "--point", str(index), "--csv", "one.csv"]) == 0
    lines = capsys.readouterr().out.splitlines()
    at = lines.index("simulated: not verified within 0.001")
    found = dict(line.strip().split(None, 1) for line in lines[at + 1 : at + 6])
    point, end = front[index], float(found["end"])
    assert end == pytest.approx(point.simulated["end"]) and end != pytest.approx(point.objectives["end"])
    assert float(found["defect"]) == pytest.approx(point.defect, rel=0.05) and found["note"] == point.note
    assert float(found["violation"]) == pytest.approx(point.simulated_violation, rel=0.05, abs=1e-12)
    assert Path("one.csv").read_text().startswith("phase,time [s],x,u")
    assert main(["verify", "rough.nc", "--problem", "glide.py:rough"]) == 1
    assert main(["verify", "rough.nc", "--problem", "glide.py:rough", "--tolerance", "0.5"]) == 0


@pytest.mark.slow
def test_how_much_points_may_miss_is_of_the_problem_or_of_the_call(capsys):
    options = ["--mesh", "fixed", "--seed", "1", "--evaluations", "40", "--out", "front.nc"]
    assert main(["solve", "glide.py:forgiving", *options]) == 0
    assert Front.load("front.nc").stats["verify"] == 0.5 and Front.load("front.nc").verified.all()
    capsys.readouterr()
    assert main(["solve", "glide.py:rough", *options, "--verify", "none"]) == 0
    out = capsys.readouterr().out
    front = Front.load("front.nc")
    assert len(front) and not front.was_simulated.any() and "defect" not in out and "See" not in out
    assert main(["show", "front.nc", "--point", "1"]) == 0 and "verified" not in capsys.readouterr().out


def test_an_adaptive_mesh_and_no_derivatives_are_what_the_solver_gets():
    assert make_solver("macs") == macs.MACS()
    assert make_solver("MACS", plain=True, mesh="adaptive") == macs.MACS(refine=False, mesh="adaptive")
    assert make_solver("macs", polish_on="dfet:8x3") == macs.MACS(polish_on="dfet:8x3")
    assert make_solver("nsga2") == macs.NSGA2()


def test_nothing_feasible_is_a_no_and_still_a_file(capsys):
    assert main(["solve", "glide.py:impossible", "--out", "no.nc"]) == 1
    assert "twice" in capsys.readouterr().out
    assert len(Front.load("no.nc")) == 0
    assert main(["show", "no.nc"]) == 0 and main(["verify", "no.nc", "--trust"]) == 1


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (["solve", "glide.py:build", "--transcription", "radeau:2x3"], ["'radeau:2x3'", "radau:10x4", "dfet:4x6"]),
        (["solve", "godard"], ["'godard'", "did you mean 'goddard'", "orbit_rise"]),
        (["solve", "goddard", "--solver", "mcas"], ["'mcas'", "did you mean macs?"]),
        (["solve", "goddard", "--transcription", "dfet:4"], ["'dfet:4'", "dfet:4x6"]),
        (["solve", "goddard", "--transcription", "shooting:9:cubic"], ["'cubic'", "constant, linear, spline", "rk4"]),
        (["solve", "goddard", "--transcription", "shooting:1"], ["nodes must be a whole number of at least 2"]),
        (["solve", "glide.py:lagging", "--transcription", "shooting:20"], ["'leg'", "'x'", "rk4", "nodes=", "steps="]),
        (["solve", "goddard", "--transcription", "shooting:9", "--mesh", "adaptive"], ["needs DFET", "SingleShooting"]),
        (["solve", "goddard", "--polish-on", "dfet:4"], ["polish_on", "'dfet:4'", "dfet:4x6"]),
        (["solve", "goddard", "--polish-on", "dfet:8x3", "--no-refine"], ["polish_on", "refine=False"]),
        (["solve", "goddard", "--polish-on", "dfet:8x3", "--solver", "nsga2"], ["--polish-on dfet:8x3", "'nsga2'"]),
        (["solve", "goddard", "--mesh", "adaptve"], ["'adaptve'", "did you mean adaptive?", "fixed"]),
        (["solve", "goddard", "--inner", "propagat"], ["'propagat'", "did you mean propagate?", "ipopt"]),
        (["solve", "goddard", "--evaluations", "ten"], ["--evaluations", "'ten' is not a whole number above 0"]),
        (["solve", "goddard", "--evaluations", "0"], ["'0' is not a whole number above 0"]),
        (["solve", "goddard", "--seed", "-1"], ["'-1' is not"]),
        *((["solve", "goddard", "--verify", word], ["--verify", f"'{word}'"]) for word in ("0", "-1", "much", "None")),
        (["solve", "goddard", "--time-limit", "0"], ["seconds above 0"]),
        (["solve", "goddard", "--seeed", "3"], ["--seeed", "did you mean --seed?"]),
        (["solve", "goddard", "--out", "nowhere/front.nc"], ["nowhere/front.nc", "there is no folder"]),
        (["solve", "goddard", "--out", "."], ["it is a folder"]),
        (["solve", "goddard", "--plot", "nowhere/front.png"], ["nowhere/front.png", "there is no folder"]),
        (["solve", "goddard", "--plot", "front.docx"], ["front.docx", ".png"]),
        (["solve", "goddard", "--checkpoint", "nowhere/run.ckpt"], ["nowhere/run.ckpt", "there is no folder"]),
        (["solve", "goddard", "--checkpoint", "glide.py"], ["'glide.py' is no checkpoint", "something else", "left as it is"]),
        (["solve", "goddard", "--checkpoint", "a.nc", "--out", "./a.nc"], ["--checkpoint a.nc would be overwritten"]),
        (["solve", "missing.py:build"], ["no file 'missing.py'"]),
        (["solve", "glide.py:missing"], ["no function 'missing'"]),
        (["solve", "glide.py:broken"], ["NameError", "undefined_name", "(line ", " of glide.py)"]),
        (["solve", "glide.py"], ["'glide.py' is a file", "'glide.py:function'"]),
        (["solve", "glide.py:nothing"], ["must return a Problem"]),
        (["solve", "glide.py:build", "--data", "sped=2"], ["does not take sped", "did you mean speed?"]),
        (["solve", "glide.py:rough", "--data", "speed=2"], ["nor any other data"]),
        *(
            (["solve", "glide.py:build", "--data", word], ["--data"])
            for word in ("speed", "speed=", "=2", "speed=3,5", "speed=1979-05-27", "speed=2\nmore=3")
        ),
        (["solve", "glide.py:build", "--data", "speed=2", "--data", "speed=3"], ["given twice"]),
        (["solve", "glide.py:build", "--data", "speed=fast"], ["must be a number, not 'fast'"]),
        (["solve", "glide.py:build", "--start", "smoth"], ["did you mean smooth? there are uniform, smooth, or the file of a front"]),
        (["solve", "glide.py:build", "--start", "glide.py"], ["does not hold a front"]),
        (["show", "missing.nc"], ["no file 'missing.nc'"]),
        (["show", "glide.py"], ["not a netCDF-4 file"]),
        (["verify", "missing.nc"], ["no file 'missing.nc'"]),
        (["solve", "welded_beam", "--transcription", "dfet:4x6"], ["it takes no transcription"]),
        (["solve", "welded_beam", "--inner", "auto"], ["it takes no inner level"]),
        (["solve", "welded_beam", "--solver", "sweep"], ["Sweep needs derivatives"]),
        (["solve", "welded_beam", "--polish-on", "dfet:4x3:bernstein"], ["polish_on does not apply"]),
        (["study", "status", "nowhere"], ["macs study status: there is no folder 'nowhere'"]),
        (["study", "run", "gliderz"], ["unknown study 'gliderz'"]),
        (["study", "run", "goddard-table-3"], ["did you mean goddard-table3?"]),
        (["study", "run", "nothing.toml"], ["there is no file 'nothing.toml'"]),
        (["study", "run", "gliders.toml", "--jobs", "2", "--dask", "tcp://localhost:1"], ["give one of them"]),
        (["study", "run", "--solvers", "MACS", "goddard-table3"], ["write them before --solvers"]),
        (["study", "run", "gliders.toml", "--trust", "--solvers", "others"], ["unknown solver 'others'"]),
        (["study", "run", "gliders.toml", "--trust", "--runs", "0"], ["not a whole number above 0"]),
        (["study", "run", "gliders.toml", "--job", "2"], ["did you mean --jobs?"]),
        (["study", "run", "gliders.toml", "--trust", "--out", "."], ["contains no study but other things"]),
        *(([command, name], [name]) for command in ("report", "serve") for name in ("missing.nc", "text.nc", "empty")),
        (["report", "text.nc", "--html", "none/page.html"], ["there is no folder"]),
        (["report", "text.nc", "--html", "page.nc"], ["ends with .html"]),
        *((["serve", "gliders.toml", "--port", port], ["is not a port"]) for port in ("70000", "-1", "http")),
        (["sovle"], ["'sovle'", "solve"]),
        (["list", "everything"], ["'everything'"]),
        ([], ["COMMAND"]),
    ],
)
def test_a_wrong_call_is_answered_in_one_line(refused, call, words):
    line = refused(*call)
    assert all(word in line for word in words), line


def test_a_wrong_call_in_a_process(here):
    done = subprocess.run([*MACS, "solve", "godard"], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("number", [pytest.param("SIGINT", marks=pytest.mark.slow), "SIGTERM"])
def test_ctrl_c_and_kill_keep_what_was_found(here, number):
    call = [*MACS, "solve", "goddard", "--evaluations", "10000000", "--out", "front.nc"]
    with subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stderr.readline()
        process.send_signal(getattr(signal, number))
        out, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "ended early (interrupted)" in out and "front saved in front.nc" in out
    assert Front.load("front.nc").stats["stopped"] == "interrupted"


@pytest.mark.slow
def test_data_go_to_the_function_and_stay_with_the_front(capsys):
    assert main(["solve", "glide.py:build", "--data", "speed=2.5", "--evaluations", "40", "--seed", "1", "--out", "slow.nc"]) == 0
    front = Front.load("slow.nc")
    assert front.source.data == {"speed": 2.5} and {v.upper for v in front.variables if ".u" in v.name} == {2.5}
    capsys.readouterr()
    assert main(["verify", "slow.nc", "--problem", "glide.py:build"]) == 0, "with the same data"
    assert main(["decide", "slow.nc", "--problem", "glide.py:build", "--reference", "time=2", "--json", "choice.json"]) == 0
    assert main(["decide", "choice.json", "--problem", "glide.py:build", "--out", "choice.nc"]) == 0
    assert Front.load("choice.nc").source.data == {"speed": 2.5}


@pytest.mark.slow
def test_a_front_is_the_start_of_a_search_with_other_data(capsys):
    assert main(["solve", "glide.py:build", "--evaluations", "40", "--seed", "1", "--out", "front.nc"]) == 0
    call = ["solve", "glide.py:build", "--data", "speed=2", "--start", "front.nc", "--evaluations", "40", "--seed", "1"]
    assert main([*call, "--out", "other.nc"]) == 0
    assert Front.load("other.nc").objectives[:, 1].max() == pytest.approx(10.0)


@pytest.mark.slow
def test_a_time_limit_ends_a_search_with_its_front(capsys):
    assert main(["solve", "goddard", "--evaluations", "10000000", "--time-limit", "3", "--out", "front.nc"]) == 0
    assert "ended early (time limit)" in capsys.readouterr().out
    front = Front.load("front.nc")
    assert len(front) and front.stats["stopped"] == "time limit" and front.stats["evaluations"] < 10_000_000


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_kill_ends_what_ignores_ctrl_c():
    """As of a shell in the background; outside of work that ends by itself."""
    code = (
        "import signal, time\nfrom runs.cli.answers import ended_as_by_ctrl_c\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "with ended_as_by_ctrl_c():\n    signal.raise_signal(signal.SIGTERM)\n    time.sleep(30)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=20).returncode == -signal.SIGTERM


@pytest.mark.slow
def test_a_run_that_died_goes_on_from_its_checkpoint(capsys, refused, monkeypatch):
    call = ["solve", "glide.py:build", "--evaluations", "150", "--seed", "1"]
    assert main([*call, "--out", "whole.nc"]) == 0
    whole = Front.load("whole.nc")
    advance = macs.MACS.advance

    def dies(self, state, evaluator, budget):
        if state.iteration == 2:
            raise KeyboardInterrupt
        advance(self, state, evaluator, budget)

    with monkeypatch.context() as patch:
        patch.setattr(macs.MACS, "advance", dies)
        assert main([*call, "--checkpoint", "run.ckpt", "--out", "part.nc"]) == 130
    assert Path("run.ckpt").exists() and not Path("part.nc").exists()
    capsys.readouterr()
    assert "seed is 1 there, 2 here" in refused(*call[:-1], "2", "--checkpoint", "run.ckpt")
    assert main([*call, "--checkpoint", "run.ckpt", "--out", "rest.nc"]) == 0
    rest = Front.load("rest.nc")
    assert rest.F.tobytes() == whole.F.tobytes() and rest.decision.tobytes() == whole.decision.tobytes()
    assert rest.stats["evaluations"] == whole.stats["evaluations"]


def test_show_prints_draws_and_exports(capsys):
    front = flights(3)
    front.replace(stats=front.stats | {"solves_for": {"ends": 3}, "iterations_for": {"ends": 41}, "kept_for": {"ends": 1}}).save("front.nc")
    marked(front, [True] * 3).save("good.nc")
    for options in ([], ["--details"]):
        assert main(["show", "good.nc", *options]) == 0 and ("defect" in capsys.readouterr().out) == bool(options)
    assert main(["show", "front.nc", "--plot", "a.pdf", "--csv", "a.csv"]) == 0
    out = capsys.readouterr().out
    assert (
        "ends                      3          41     1" in out
        and "height" in out
        and "picture in a.pdf" in out
        and "values in a.csv" in out
    )
    assert Path("a.pdf").read_bytes().startswith(b"%PDF") and Path("a.csv").read_text().startswith("point,time [s],height [km]")


def test_show_any_point(capsys, refused):
    sweep(cart(), MESH, points=4, starts=1).save("cart.nc")
    Path("trip.py").write_text("from carts import cart\n\ndef build():\n    return cart()\n")
    assert main(["show", "cart.nc", "--at", "distance=2 m", "--problem", "trip.py:build", "--csv", "trip.csv", "--plot", "trip.png"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"effort +(2|2\.0000\d+|1\.9999\d+)\n", out) and "verified within" in out, "x' = u for two seconds, of least effort"
    assert Path("trip.csv").read_text().startswith("phase,time") and Path("trip.png").read_bytes().startswith(b"\x89PNG")
    assert main(["show", "cart.nc", "--at", "distance=2, effort=1", "--problem", "trip.py:build"]) == 0
    assert "lies off the front" in capsys.readouterr().out
    assert "stated in a script" in refused("show", "cart.nc", "--at", "effort=2")


@pytest.mark.slow
def test_show_one_point(saved, capsys, refused):
    path = str(saved[0] / "front.nc")
    assert main(["show", path, "--point", "-1", "--plot", "b.png", "--costates", "--csv", "b.csv"]) == 0
    out = capsys.readouterr().out
    assert "phase ascent" in out and "final value of ascent.y" in out
    state, control = out.index("  y [km]"), out.index("  u [rad]")
    assert state < control and len(out[control:].splitlines()[0].split()) == 6
    assert Path("b.png").read_bytes().startswith(b"\x89PNG") and len(Path("b.csv").read_text().splitlines()) == 1 + len(
        Front.load(path)[-1].trajectory["ascent"].time
    )
    assert "--costates is for the picture of a trajectory" in refused("show", path, "--costates", "--plot", "c.png")
    assert "there is no point 99: the front has points 0 to" in refused("show", path, "--point", "99")


@pytest.mark.slow
def test_verify_says_which_point_fails_and_why(saved, capsys, refused):
    path = str(saved[0] / "front.nc")
    assert main(["verify", path, "--tolerance", "10"]) == 0
    assert "points verify" in capsys.readouterr().out
    assert main(["verify", path, "--tolerance", "1e-13", "--rtol", "1e-9"]) == 1
    out = capsys.readouterr().out
    assert "FAILS" in out and ": simulated, it" in out
    assert "belongs to problem 'goddard'" in refused("verify", path, "--problem", "orbit_rise")


def test_a_result_overwrites_no_file_of_another_kind(capsys, refused, tmp_path, monkeypatch):
    monkeypatch.setattr("macs.solvers.solver.Solver.solve", lambda *_, **__: pytest.fail("the work started"))
    source = tmp_path / "mine.py"
    source.write_text("print('mine')\n", encoding="utf-8")
    assert "would overwrite a file that is no front" in refused("solve", "goddard", "--out", str(source))
    assert source.read_text(encoding="utf-8") == "print('mine')\n"
    same = str(tmp_path / "q.png")
    assert "would overwrite the front" in refused("solve", "goddard", "--out", same, "--plot", same)


def test_a_terminal_obeys_no_text_of_a_file(capsys):
    front = flights(3)
    front.message = "\x1b[31mred\u202e\x9b2J"
    front.save("red.nc")
    assert main(["show", "red.nc"]) == 0 and main(["show", "\x1b[31mgone.nc"]) == 2
    said = capsys.readouterr()
    assert not re.search("[\x1b\u202e\x9b]", said.out + said.err)
    assert "\\x1b[31mred\\u202e\\x9b2J" in said.out and "\\x1b[31mgone.nc" in said.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_streams_that_are_closed_or_full(here, monkeypatch):
    flights(3).save("front.nc")
    with monkeypatch.context() as closed:
        for name in ("stdin", "stdout", "stderr"):
            closed.setattr(sys, name, None)
        assert main(["show", "front.nc"]) == 0 and main(["show", "gone.nc"]) == 2
    with monkeypatch.context() as full, Path("/dev/full").open("w") as out, Path("/dev/full").open("w") as words:
        full.setattr(sys, "stderr", words)
        assert main(["show", "gone.nc"]) == 2
        full.setattr(sys, "stdout", out)
        assert main(["show", "front.nc"]) == 1, "the call was right"
        for one in (out, words):  # what is left in them cannot be written when they are closed
            with pytest.raises(OSError, match="No space"):
                one.close()
