"""Commands of the command line: each takes the parsed arguments, prints, and returns an exit code."""

from __future__ import annotations

import inspect
import shlex
import sys
from argparse import Namespace
from collections.abc import Iterable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import problems
import transcription
from macs.front import Front
from macs.fronts.pictures.front_plot import save_front, save_picture
from macs.fronts.point import Point
from macs.fronts.tables import solves_table
from macs.fronts.verification import Check
from macs.fronts.verification import verify as verify_front
from macs.io.atomic import check_target
from macs.io.interrupts import Interrupts
from macs.io.text import label, text_table
from macs.search.settings import MESH_WORDS
from macs.solvers.solver import Solver, solver_class
from problems.catalogue import is_catalogued
from problems.checks import unknown
from transcription.inner import NAMED

from ..batch import file as studyfile
from . import decide_command
from .answers import DONE, FAILED, INTERRUPTED, WrongCall, complain, wrong_call_on_value_error
from .inputs import check_is_front, check_picture, find_start, load_problem, problem_of, read_data, read_json, same_file, saved

if TYPE_CHECKING:
    from ..report.page import Page

UNSIMULATED = "none"
"""Word for points that are not to be simulated."""


def list_all(arguments: Namespace) -> int:
    """The problems and the studies there are."""
    cases = {name: problems.describe(name) for name in problems.names()}
    batches = {name: f"study: {studyfile.describe(name)}" for name in studyfile.names()}
    width = max(map(len, (*cases, *batches)))
    for name, text in (cases | batches).items():
        print(f"{name:{width}}  {text}")
    return DONE


def solve(arguments: Namespace) -> int:
    """Search, simulate every point, print, save, draw."""
    problem = load_problem(arguments.problem, **read_data(arguments.data or []))
    with wrong_call_on_value_error():
        scheme = None if arguments.transcription is None else transcription.parse(arguments.transcription)
    mesh = choose(arguments.mesh, MESH_WORDS, "kind of mesh") if arguments.mesh else None
    solver = make_solver(arguments.solver, arguments.no_refine, mesh, arguments.polish_on, arguments.prefer)
    verify = None if arguments.verify == UNSIMULATED else arguments.verify or problem.default_verify
    inner = arguments.inner and choose(arguments.inner, NAMED, "inner level")
    start = find_start(arguments.start)
    out = Path(arguments.out) if arguments.out else free_name(problem.name)
    check_target(out)
    check_is_front(out)
    check_picture(arguments.plot)
    if arguments.plot and same_file(arguments.plot, out):
        raise WrongCall(f"--plot {arguments.plot} would overwrite the front")
    if isinstance(start, Front) and same_file(arguments.start, out):
        raise WrongCall(f"--out {out} would overwrite the front that the search starts from")
    if arguments.checkpoint:
        check_target(arguments.checkpoint)
    if arguments.checkpoint and any(same_file(arguments.checkpoint, path) for path in (out, arguments.plot) if path):
        raise WrongCall(f"--checkpoint {arguments.checkpoint} would be overwritten by the result")
    with Interrupts() as interrupts:
        with wrong_call_on_value_error():
            front = solver.solve(
                problem,
                scheme,
                evaluations=arguments.evaluations,
                seed=arguments.seed,
                inner=inner,
                start=start,
                verify=verify,
                time_limit=arguments.time_limit,
                checkpoint=arguments.checkpoint,
                progress=True,
            )
        if interrupts.reason and not len(front) and front.closest is None:
            complain(front.message, "macs solve")
            return INTERRUPTED
        place, trouble = saved(front, out)
        print(front.table())
        if front.was_simulated.any() and not front.verified.all():
            named = "" if is_catalogued(problem.address) else f" --problem {arguments.problem}"
            print(f"See `macs verify {place or out}{named}`.")
        if not trouble:
            print(f"\nfront saved in {out}")
        elif place:
            trouble = f"{trouble}; the front is saved in '{place}' instead"
        if arguments.plot:
            try:
                draw(front, arguments.plot)
            except OSError as error:
                trouble = "; ".join(filter(None, (trouble, error.strerror or str(error))))
        if trouble:
            complain(trouble, "macs solve")
            return FAILED
        if interrupts.reason:
            return INTERRUPTED
    return DONE if len(front) else FAILED


def show(arguments: Namespace) -> int:
    """A saved front, or one of its points."""
    check_picture(arguments.plot)
    if arguments.costates and ((arguments.point is None and not arguments.at) or not arguments.plot):
        raise WrongCall("--costates is for the picture of a trajectory: --point I --plot FILE")
    if arguments.csv:
        check_target(arguments.csv)
        if same_file(arguments.csv, arguments.front):
            raise WrongCall(f"--csv {arguments.csv} would overwrite the front itself")
    with wrong_call_on_value_error():
        front = Front.load(arguments.front, trust=arguments.trust)
        if arguments.problem and front.source is not None:
            front = front.replace(problem=front.source.check(problem_of(front.source, arguments.problem), arguments.front))
        if arguments.at:  # in place of --point
            wanted = decide_command.assignments(",".join(arguments.at), front.goals)
            found = front.at(wanted) if len(wanted) < len(front.goals) else front.nearest(wanted)
            front, arguments.point = Front.of(found.alone()), 0
    point = None if arguments.point is None else find_point(front, arguments.point)
    if arguments.plot and point is not None and front.dynamic and point.trajectory is None:
        raise WrongCall(f"point {arguments.point} has no trajectory to draw")
    print(
        "\n\n".join(filter(None, (front.table(details=arguments.details), solves_table(front))))
        if point is None
        else describe(front, point)
    )
    if arguments.plot:
        draw(front if point is None else point, arguments.plot, costates=arguments.costates)
    if arguments.csv:
        (front if point is None else point).to_csv(arguments.csv)
        print(f"values in {arguments.csv}")
    return DONE


def verify(arguments: Namespace) -> int:
    """Check every point of a saved front."""
    with wrong_call_on_value_error():
        front = Front.load(arguments.front, trust=arguments.trust)
    if front.source is None:
        raise WrongCall(f"{arguments.front} is a front of a black box: there is nothing to simulate or to evaluate again")
    if not arguments.problem and not front.source.address:
        raise WrongCall(f"problem '{front.source.name}' was stated in a script; give it: --problem file.py:function")
    with wrong_call_on_value_error():
        problem = problem_of(front.source, arguments.problem) if arguments.problem else front.source.load()
        tolerance = arguments.tolerance or problem.default_verify
        front = front.replace(problem=front.source.check(problem, arguments.front))
        checks = verify_front(front, tolerance=tolerance, rtol=arguments.rtol)
    print(verification_table(front, checks))
    failed = [check for check in checks if not check.ok]
    if not checks:
        print(f"There is no point to verify. {front.message}".rstrip())
    elif failed:
        print(f"\n{len(failed)} of {len(checks)} points fail, by a tolerance of {tolerance:g}.")
    else:
        how = "simulated, they" if front.dynamic else "evaluated again, they"
        print(f"\nAll {len(checks)} points verify: {how} stay within {tolerance:g}.")
    return DONE if checks and not failed else FAILED


def bench(arguments: Namespace) -> int:
    """Ratios against the alternatives."""
    from ..bench import BENCHES, header_of, solvers_of
    from ..bench import bench as measure

    kind, quick = arguments.what, arguments.quick
    kinds = [choose(kind, sorted(BENCHES), "benchmark")] if kind else sorted(BENCHES)
    seeded, kept = ([name for name in kinds if getattr(BENCHES[name], has)] for has in ("seeded", "kept"))
    if arguments.csv:
        check_target(arguments.csv)
    if arguments.seeds and (quick or not seeded):
        those = ", ".join(name for name in sorted(BENCHES) if BENCHES[name].seeded)
        raise WrongCall("--seeds: --quick has one seed" if quick else f"--seeds: '{kind}' has none; those with seeds are {those}")
    for option, given in (("jobs", arguments.jobs > 1), ("keep", arguments.keep), ("solvers", arguments.solvers)):
        if given and (quick or not kept):
            those = ", ".join(name for name in BENCHES if BENCHES[name].kept)
            raise WrongCall(f"--{option}: is for searches on plain functions ({those}), without --quick")
    for option, given in (("against", arguments.against), ("problems", arguments.problems)):
        if given and kind != "corpus":
            raise WrongCall(f"--{option}: is for the corpus")
    if arguments.only and kind not in ("corpus", "curve"):
        raise WrongCall(f"problems are for the corpus and for curves, not for '{kind}'")
    chosen = tuple(dict.fromkeys(arguments.solvers or ()))
    if chosen:
        if not kind:
            raise WrongCall("--solvers: of which one? Sets of functions have different ones")
        known = solvers_of(kind)
        for one in chosen:
            choose(one, known, "solver")
        if known[0] not in chosen:
            raise WrongCall(f"--solvers: {known[0]} must be among them")
    settings = {"quick": quick, "seeds": arguments.seeds, "jobs": arguments.jobs, "keep": arguments.keep, "solvers": chosen}
    if arguments.page:
        if not kind:
            raise WrongCall("--page: of which one? a page is of a single benchmark")
        check_target(arguments.page)
        with wrong_call_on_value_error():
            header_of(kind, arguments.page, **settings)
    # A folder that contains something else, or that another process has locked; a file of something else.
    with wrong_call_on_value_error() if arguments.keep or arguments.against or arguments.only else nullcontext():
        files = {"csv": arguments.csv, "page": arguments.page, "against": arguments.against}
        return DONE if measure(kinds, problems=arguments.problems, only=arguments.only, **files, **settings) else FAILED


# Studies, and pages for the browser


def study(arguments: Namespace) -> int:
    """Run a study, show its state, or report on it."""
    return {"run": run_study, "status": study_status, "report": study_report}[arguments.action](arguments)


def run_study(arguments: Namespace) -> int:
    """Make the runs that are missing."""
    from ..batch.running import WorkersLost
    from ..execution.processes import cluster
    from ..study import Study

    if arguments.dask and arguments.jobs:
        raise WrongCall("--jobs is for this machine, --dask for a cluster: give one of them")
    with wrong_call_on_value_error():
        batch = Study.load(arguments.study, trust=arguments.trust)
        batch = batch if arguments.runs is None else replace(batch, runs=arguments.runs)
        batch = batch.quick() if arguments.quick else batch
    out = Path(arguments.out or Path("out") / batch.name)
    again = "finished runs are kept; the same command goes on from there"
    try:
        with wrong_call_on_value_error(), cluster(arguments.dask) if arguments.dask else nullcontext() as executor:
            jobs, retry, solvers = arguments.jobs or 1, arguments.retry, arguments.solvers
            chosen = {"retry": retry, "fresh": arguments.fresh, "solvers": solvers}
            summary = batch.run(out, jobs=jobs, executor=executor, progress=True, **chosen)
    except KeyboardInterrupt:
        print(f"interrupted; {again}", file=sys.stderr)
        return INTERRUPTED
    except WorkersLost as error:
        print(error, file=sys.stderr)
        return FAILED
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror or error}; {again}") from error
    print(f"{summary}\n\nin {out}")
    asked = [run for run in summary.runs if solvers is None or run.cell.solver in solvers]
    return DONE if all(run.finished for run in asked) else FAILED


def study_status(arguments: Namespace) -> int:
    """The state of a study."""
    from ..batch.store import Store

    with wrong_call_on_value_error():
        summary = Store.open(arguments.folder).summary()
    print(summary)
    return DONE if summary.finished == len(summary.runs) else FAILED


def study_report(arguments: Namespace) -> int:
    """Tables on the terminal, and with the figures in the study's folder."""
    from ..report.report import FOLDER, report

    foreign: dict[str, list[str]] = {}
    for word in arguments.join or []:
        name, equals, path = word.partition("=")
        if not (name and equals and path):
            raise WrongCall(f"--join {word}: write NAME=FILE")
        foreign.setdefault(name, []).append(path)
    with wrong_call_on_value_error():
        page = page_of(arguments) if arguments.page else None
        drawn = not arguments.no_figures
        found = report(arguments.folder, foreign=foreign, figures=drawn, progress=True, trust=arguments.trust, page=page)
    print(f"{found}\n\n{len(found.files)} files in {Path(arguments.folder) / FOLDER}")
    return DONE


def page_of(arguments: Namespace) -> Page:
    """The page that a report is also written to. Raises ValueError or OSError if it cannot be, or the study's file is not found."""
    from ..batch.store import Store
    from ..report.page import Page
    from ..study import Study

    if arguments.no_figures or arguments.join:
        raise WrongCall("--page is for a report with figures, of the study's own runs alone: without --no-figures and --join")
    source = arguments.study or Store.open(arguments.folder, arguments.trust).definition["name"]
    stated = f" --study {shlex.quote(arguments.study)}" if arguments.study else ""
    trusted = " --trust" if arguments.trust else ""
    command = f"macs study report {shlex.quote(arguments.folder)} --page {shlex.quote(arguments.page)}{stated}{trusted}"
    return Page(arguments.page, command, studyfile.find(source), Study.load(source, trust=arguments.trust).definition())


def page_report(arguments: Namespace) -> int:
    """A front or a study as one file for the browser."""
    from ..browser.pages import write_page

    source = find_source(arguments.source)
    out = Path(arguments.html) if arguments.html else _beside(source)
    if not arguments.html:
        out.parent.mkdir(exist_ok=True)
    elif out.suffix.lower() not in (".html", ".htm"):
        raise WrongCall(f"--html {out}: the name of a page ends with .html")
    with wrong_call_on_value_error():
        write_page(source, out, trust=arguments.trust, progress=True)
    print(f"page in {out}")
    return DONE


def serve(arguments: Namespace) -> int:
    """The same page, live, from a server that only reads; until Ctrl-C."""
    from ..browser.live import followed
    from ..browser.server import Server

    path = find_source(arguments.source)
    with wrong_call_on_value_error():
        server = Server(followed(path, arguments.trust), arguments.host, arguments.port)
    with suppress(KeyboardInterrupt), server:
        if not server.local:
            print("warning: everybody on the network can read this; without --host only this machine can", file=sys.stderr)
        print(f"{path} is shown at {server.url} until Ctrl-C", flush=True)
        server.serve_forever()
    return DONE


def find_source(word: str) -> Path:
    """A front's file or a study's folder; for the name of a study the folder that it ran into by default."""
    ran = Path("out") / word
    return ran if not Path(word).exists() and (ran / "study.json").is_file() else Path(word)


def _beside(source: Path) -> Path:
    """Where the page of a front or study is written by default. Raises `WrongCall` if there is no such front or study."""
    if source.is_dir():
        if not (source / "study.json").is_file():
            raise WrongCall(f"'{source}' contains no study: there is no study.json in it")
        return source / "report" / "report.html"
    if not source.is_file():
        raise WrongCall(f"there is no file or folder '{source}'")
    return source.with_suffix(".html")


# Arguments


def make_solver(name: str, plain: bool = False, mesh: str | None = None, polish_on: str | None = None, prefer: str | None = None) -> Solver:
    """A solver by its name in lower case, `plain` without derivatives, with a word for the mesh, polished on another transcription, or
    guided by the preference in a file."""
    with wrong_call_on_value_error():
        solver = solver_class(name)
        known = inspect.signature(solver).parameters
        options = {
            "refine": ("--no-refine", plain, "which never uses derivatives"),
            "mesh": (f"--mesh {mesh}", mesh, "which does not change meshes"),
            "polish_on": (f"--polish-on {polish_on}", polish_on, "which does not polish"),
            "prefer": (f"--prefer {prefer}", prefer, "which no preference guides"),
        }
        for setting, (option, given, reason) in options.items():
            if given and setting not in known:
                raise WrongCall(f"{option} does not apply to solver '{name}', {reason}")
        values = {"refine": False if plain else None, "mesh": mesh, "polish_on": polish_on, "prefer": prefer and read_preference(prefer)}
        return solver(**{setting: value for setting, value in values.items() if value is not None})


def read_preference(path: str) -> dict[str, Any]:
    """What a JSON file says of a preference; see `macs.decisions.to_dict`."""
    try:
        found = read_json(path)
    except ValueError as error:
        raise WrongCall(f"--prefer: {error}") from None
    if not isinstance(found, dict):
        raise WrongCall(f'--prefer {path} must have a preference, such as {{"method": "WeightedSum", "settings": {{"weights": ...}}}}')
    return found


def choose(word: str, known: Iterable[str], kind: str) -> str:
    """`word`, if it is known; else WrongCall with the ones that are."""
    if word not in known:
        raise WrongCall(unknown(kind, word, known))
    return word


def find_point(front: Front, index: int) -> Point:
    """A point by its number."""
    try:
        return front[index]
    except IndexError:
        last = f"points 0 to {len(front) - 1}" if len(front) else "no points"
        raise WrongCall(f"there is no point {index}: the front has {last}") from None


def free_name(problem: str) -> Path:
    """A file of the problem's name, here, that does not exist yet."""
    stem = "".join(c if c.isalnum() or c in "-_." else "_" for c in problem).strip(".") or "front"
    names = (Path(f"{stem}{f'-{i}' if i > 1 else ''}.nc") for i in range(1, 10**6))
    return next(name for name in names if not name.exists())


# Output


def draw(drawn: Front | Point, path: str, costates: bool = False) -> None:
    """Draw a front, or a point's trajectory, with or without costates."""
    if isinstance(drawn, Front):
        save_front(drawn, path)
    else:
        save_picture(drawn, path, **({"costates": True} if costates else {}))
    print(f"picture in {path}")


def describe(front: Front, point: Point) -> str:
    """One point, in full."""
    objectives = {label(goal.name, goal.unit): f"{point.objectives[goal.name]:.10g}" for goal in front.goals}
    excursions = {name: f"{value:.2g}" for name, value in (point.excursions or {}).items()}
    units = {variable.name: variable.unit for variable in point.variables}
    groups = {
        f"point {point.index} of {len(front)}, {point.status}": objectives,
        _verdict(front, point): _simulated(front, point),
        "parameters" if front.dynamic else "variables": {
            label(name, units.get(name, "")): f"{value:.10g}" if isinstance(value, float) else str(value)
            for name, value in point.parameters.items()
        },
        f"violation, {point.violation:.1e} at most": {name: f"{value:.1e}" for name, value in point.violations.items()},
        "leaves bounds between nodes, by this much of the scale": excursions,
        "costates are those of the sum of objectives, minimised, times": {
            name: f"{one:.6g}" for name, one in (point.weights or {}).items()
        },
    }
    lines = [front.table().splitlines()[0], ""]
    for title, values in groups.items():
        width = max(map(len, values), default=0)
        lines += [title, *(f"  {name:{width}}  {value}" for name, value in values.items()), ""] if values else []
    for name, phase in (point.trajectory or {}).items():
        lines += [f"phase {name}: {phase.t0:.6g} to {phase.tf:.6g} {phase.time_unit}", _ends(phase), ""]
    return "\n".join(lines).rstrip()


def _verdict(front: Front, point: Point) -> str:
    """Whether a point is verified, and within what."""
    how = "simulated" if front.dynamic else "evaluated again"
    return f"{how}: {'verified' if point.verified else 'not verified'} within {front.stats.get('verify', 0.0):g}"


def _simulated(front: Front, point: Point) -> dict[str, str]:
    """What the simulation of a point found; nothing if it was not simulated."""
    if point.simulated is None:
        return {}
    values = {label(goal.name, goal.unit): f"{point.simulated[goal.name]:.10g}" for goal in front.goals}
    errors = {"defect": f"{point.defect:.1e}"} if front.dynamic else {}
    errors["violation"] = f"{point.simulated_violation:.1e}"
    return {**values, **errors, **({"note": point.note} if point.note else {})}


def _ends(phase: Any) -> str:
    """Initial and final values of states and controls, and their least and greatest values at the nodes."""
    ends = [phase.at(time) for time in (phase.t0, phase.tf)]

    def row(v: Any, first: float, last: float) -> list[str]:
        values = phase[v.name]
        return [f"  {label(v.name, v.unit)}", *(f"{value:.6g}" for value in (first, last, values.min(), values.max()))]

    rows = [row(*three) for three in zip(phase.state_variables, phase.edge_states[0], phase.edge_states[-1], strict=True)]
    rows += [["  control"] + 4 * [""]] if phase.control_variables else []
    rows += [row(v, ends[0][v.name], ends[1][v.name]) for v in phase.control_variables]
    return text_table([["  state", "initial", "final", "least", "greatest"]], rows, [True, False, False, False, False])


def verification_table(front: Front, checks: Sequence[Check]) -> str:
    """A row for each point, simulated or of a vector problem evaluated again, and the reasons of those that fail."""
    columns = {
        "mismatch": ("trajectory", "stored - decision"),
        "objectives": ("objectives", "stored - again"),
        "violation": ("violation", "again"),
        "defect": ("defect", "simulated"),
        "simulated": ("violation", "simulated"),
        "missed": ("objectives", "stored - simulated"),
    }
    if not front.dynamic:
        columns = {name: columns[name] for name in ("objectives", "violation")} | {"missed": ("objectives", "in ranges of the front")}
    rows = [[str(c.point), *(f"{getattr(c, name):.1e}" for name in columns), "ok" if c.ok else "FAILS"] for c in checks]
    headers = [["#", *(first for first, _ in columns.values()), ""], ["", *(second for _, second in columns.values()), ""]]
    table = text_table(headers, rows, [False] * (1 + len(columns)) + [True])
    reasons = [f"point {c.point}: {'; '.join(c.reasons)}" for c in checks if not c.ok]
    return "\n".join([front.table().splitlines()[0], "", table, *([""] if reasons else []), *reasons])


COMMANDS = {
    "list": list_all,
    "solve": solve,
    "show": show,
    "verify": verify,
    "decide": decide_command.decide,
    "study": study,
    "report": page_report,
    "serve": serve,
    "bench": bench,
}
