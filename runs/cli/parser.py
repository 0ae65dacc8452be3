"""The parser of the command line, and the end of a call.

Exit codes: 0 done; 1 failed (nothing feasible, a point that does not verify, runs missing); 2 the call was wrong: one line on stderr with
the reason, and no file is left; 130 ended by Ctrl-C or SIGTERM, with what there was by then. The commands themselves are in `commands`,
which is only imported to run one: help is instant.
"""

from __future__ import annotations

import argparse
import difflib
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NoReturn

from .answers import DONE, FAILED, FULL, INTERRUPTED, WRONG, WrongCall, complain, deaf, ended_as_by_ctrl_c, ended_at_once, streams

EPILOG = """\
examples:
  macs list
  macs solve goddard
  macs solve my_problem.py:build --transcription dfet:8x3 --evaluations 20000 --seed 1 --out front.nc --plot front.png
  macs show front.nc --point 3 --plot flight.png
  macs verify front.nc --problem my_problem.py:build
  macs decide front.nc
  macs study run goddard-table3 --jobs 2
  macs study status out/goddard-table3
  macs report front.nc --html front.html
  macs serve out/goddard-table3
  macs bench inner --quick

exit codes: 0 done, 1 failed (nothing feasible, a point does not verify, runs missing, a result not saved where it was to be), 2 the call
was wrong, 130 ended by Ctrl-C or SIGTERM"""


BENCH = """\
Ratios against the alternatives, measured side by side in one run, with their spread: absolute times depend on the machine.

cf          CF of CEC 2009, as maf, with constraints: MACS against the other algorithms, hypervolume and IGD+
charges     what runs are charged beside what they take of a processor, searches and gradient solves on all transcriptions
constrained MW1-14 and DTLZ with constraints: MACS against the other algorithms at equal evaluations, hypervolume
corpus      gradient solves, iterations and CPU time for one optimum of every problem, with defaults
curve       fronts as curves: points and solves for an error, how many targets solved anew lie within it, and a finer mesh
front       whole fronts by MACS until it is done, by its other inner levels to the same quality, and by sweeps from one and ten starts
generation  how the time of a generation of NSGA-III grows with individuals, nodes and constraints, beside the orders of its paper
inner       how fast, how reliable and how near to the candidate the inner levels are, against IPOPT's defaults with a constant objective
maf         MaF with 5 objectives, which nothing was tuned on, 5,000 evaluations: hypervolume and IGD+; no target is set
many        DTLZ with 5 and 8 objectives, likewise: distance from the front, hypervolume
methods     every published problem by DFET, collocation and shooting, each in a process of its own: whether their optima agree
parts       MACS without one of its parts at a time, on problems that nothing was tuned on: hypervolume, time, number of problems solved
peers       the examples of YAPSS, from statement to solution, here, in YAPSS and in rockit: pip install 'macs-trajectories[peers]'
population  120 re-entries simulated and scored in one call, as a population search sends them, against one after the other
re          real-world problems with constraints, as maf: hypervolume
scale       how time and memory grow with elements, nodes, phases, variables, points and agents: exponents beside the limit of 1.1
search      MACS against gradient sweeps from many starts, on the same mesh, at the same number of points and counted work
standard    every published problem with defaults, each in a process of its own: ours, published, error when simulated, memory
uf          UF1 to UF10 of CEC 2009, likewise: IGD as in the competition
zdt         ZDT1-4 and 6, likewise
study       a study with two processes against one, and how much longer it takes than its runs do
wfg         WFG with 3 objectives, as maf
workers     two processes against one, and what more would bring
wild        the same as standard for problems that others asked about: each stands for a kind that was wrong once

What is asked is printed beside the measured values, and judged by medians of rounds or seeds. The exit code is 1 where anything is missed.
Ctrl-C prints the values measured so far. MACS_COMPILE=0 keeps functions from being compiled; where there is a C compiler, the benchmark of
populations shows both."""


DECIDE = """\
With the problem of the front at hand, points are found by gradients; otherwise the points of the front are ranked, and the answer says so.
Problems of `macs list` are at hand; others need --problem or --trust. With --out, --json or --plot nothing is asked, in a terminal neither.
Values may have their unit: --reference "flight time=150 s".

exit codes: 0 chosen; 1 what was chosen exceeds a hard limit, or is not feasible, or not verified; 2 the call was wrong"""


STUDY = """\
Batches of independent runs: every problem of a study by every solver. A run is a file in the study's folder, written once, whole.

macs study run STUDY     makes the runs that are missing. Stopped, killed, or with more --runs, the same command goes on; finished runs
                         are neither made again nor changed. A run that crashes, hangs beyond the study's time_limit or is killed is
                         recorded and stops no other; those killed or too late are made again by the next call, crashed ones by --retry.
                         Each run has a record of the code that made it; with --fresh those by other code are made again.
macs study status DIR    the number of finished, failed and missing runs, and the reasons of failures.
macs study report DIR    tables, statistics and figures; with --page FILE.md also a page of them, once all runs are finished.

A study file or a study's folder may name code by address (my_problem.py:build). Outside the catalogue it is loaded only with --trust.

The exit code is 1 while any run is missing or failed."""


TRANSCRIPTION = (
    "such as dfet:4x6 (4 elements of order 6) or shooting:200 (200 nodes); an unknown word shows how all are written "
    "(default: the problem's own)"
)


WORKERS = "processes that work side by side; the result is the same with any number (default: all, one for each core)"
TRUST = "load problems and references that the files name by address, outside the catalogue: this runs their code"


class Parser(argparse.ArgumentParser):
    """One line for a wrong call, not a page of usage."""

    _given: Sequence[str] = ()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse's, with the arguments kept for `error`."""
        self._given = args or ()
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """End with a message, which says so where an option that takes several values has taken what is missing."""
        several = [name for action in self._actions if action.nargs == "+" for name in action.option_strings if name in self._given]
        if several and "arguments are required" in message:
            message += f": write them before {several[0]}, which takes all values after it"
        raise SystemExit(complain(message, self.prog))


class Version(argparse.Action):
    """Prints the version that is installed; looked up only if asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        from importlib.metadata import PackageNotFoundError, version

        try:
            print(f"macs {version('macs-trajectories')}")
        except PackageNotFoundError:
            print("macs, not installed")
        raise SystemExit(DONE)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command, by default that of this process, which then ends; returns its exit code."""
    try:
        with streams(), ended_as_by_ctrl_c():
            return _answer(argv)
    except KeyboardInterrupt:
        complain("interrupted", "macs")
        return INTERRUPTED
    finally:
        if argv is None:
            deaf()


def _answer(argv: Sequence[str] | None) -> int:
    program = "macs"
    try:
        arguments, unknown = build_parser().parse_known_args(argv)
        program = arguments.parser.prog
        if unknown:
            arguments.parser.error(_unknown_option(unknown[0], arguments.parser))
        # A warning, such as that of an old file, is one line, without the place in our code.
        warnings.formatwarning = lambda message, *_: f"{program}: {message}\n"
        with ended_at_once(program):
            from macs.io.workers import processes

            from . import commands
        with processes(getattr(arguments, "workers", None)):
            code = commands.COMMANDS[arguments.command](arguments)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the output has closed it. Python would complain once more when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except WrongCall as error:
        return complain(str(error), program)
    except OSError as error:
        complain(error.strerror or str(error), program)
        return FAILED if error.errno in FULL else WRONG
    except (MemoryError, RuntimeError) as error:
        from ..execution.task import is_memory_error, memory_message

        if not is_memory_error(error):
            raise
        complain(memory_message(error), program)
        return FAILED
    return int(code)


def build_parser() -> argparse.ArgumentParser:
    """Everything that can be called."""
    parser = Parser(
        prog="macs",
        description="Multi-objective optimal control: search for fronts of verified trajectories.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)
    _add(commands, "list", "the problems and studies there are, one line each")
    _add_solve(commands)
    _add_show(commands)
    _add_verify(commands)
    _add_decide(commands)
    _add_study(commands)
    _add_report(commands)
    _add_serve(commands)
    _add_bench(commands)
    return parser


def _add(commands: argparse._SubParsersAction[Parser], name: str, text: str) -> Parser:
    command = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".", allow_abbrev=False)
    command.set_defaults(parser=command)
    return command


def _add_solve(commands: argparse._SubParsersAction[Parser]) -> None:
    solve = _add(commands, "solve", "search a problem for its front, simulate every point, save the front")
    solve.add_argument("problem", metavar="PROBLEM", help="a name of `macs list`, file.py:function or package.module:function")
    solve.add_argument(
        "--data", metavar="NAME=VALUE", action="append", help="an argument of the problem's function, such as limit=3; again for others"
    )
    solve.add_argument("--transcription", metavar="T", help=TRANSCRIPTION)
    solve.add_argument("--solver", metavar="NAME", default="macs", help="which search (default: macs)")
    solve.add_argument("--evaluations", metavar="N", type=_positive, help="candidates that may be evaluated (default: until MACS is done)")
    solve.add_argument("--time-limit", metavar="S", type=_seconds, help="seconds after which the search ends with what it has found")
    solve.add_argument("--workers", metavar="N", type=_workers, default="all", help=WORKERS)
    solve.add_argument("--seed", metavar="S", type=_natural, help="the same one gives the same front (default: drawn, and recorded)")
    solve.add_argument("--inner", metavar="NAME", help="the inner level: auto, propagate, ipopt, ... (default: the problem's own)")
    solve.add_argument(
        "--start",
        metavar="KIND|FRONT.nc",
        help="first candidates: smooth (about the guess), uniform (without the guess), or a front's points (default: the problem's own)",
    )
    solve.add_argument("--no-refine", action="store_true", help="search without derivatives of the objectives, as the paper does")
    solve.add_argument(
        "--mesh",
        metavar="KIND",
        help="which points are solved again on finer meshes: mended, those not verified (default); adaptive, all; fixed, none",
    )
    solve.add_argument(
        "--polish-on",
        metavar="T",
        help="polish the front on this transcription by gradients in the end, so that its points are feasible when simulated",
    )
    solve.add_argument("--prefer", metavar="FILE.json", help="a preference that guides the search: {method: ..., settings: {...}}")
    solve.add_argument(
        "--verify", metavar="T", type=_verify, help="largest scaled error of verified points; none: no simulation (default: problem's)"
    )
    solve.add_argument("--checkpoint", metavar="FILE", help="keep the run there; killed or interrupted, the same call goes on where it was")
    solve.add_argument("--out", metavar="FRONT.nc", help="where to save the front (default: PROBLEM.nc, here, numbered if it exists)")
    solve.add_argument("--plot", metavar="FRONT.png", help="draw the front too")


def _add_show(commands: argparse._SubParsersAction[Parser]) -> None:
    show = _add(commands, "show", "a saved front: its table, a picture, an export")
    show.add_argument("front", metavar="FRONT.nc")
    show.add_argument("--point", metavar="I", type=int, help="only this point, in detail; --plot draws its flight")
    show.add_argument("--at", metavar="NAME=VALUE", action="append", help="the point with these values, solved (of all: the nearest)")
    show.add_argument("--problem", metavar="PROBLEM", help="with --at: the problem, for a front that does not name one of `macs list`")
    show.add_argument("--trust", action="store_true", help="with --at: run the code that the file names to make its problem")
    show.add_argument("--details", action="store_true", help="with violation, defect, optimality and the like")
    show.add_argument("--plot", metavar="FILE.png", help="draw it")
    show.add_argument("--costates", action="store_true", help="with --point and --plot: costates and the Hamiltonian, too")
    show.add_argument("--csv", metavar="FILE", help="a table for a spreadsheet: a row for each point, or with --point for each node")


def _add_verify(commands: argparse._SubParsersAction[Parser]) -> None:
    verify = _add(commands, "verify", "check every point of a saved front and simulate it again; exit 1 if any fails")
    verify.add_argument("front", metavar="FRONT.nc")
    verify.add_argument("--problem", metavar="PROBLEM", help="the problem, for a front that does not name one of `macs list`")
    verify.add_argument("--trust", action="store_true", help="run the code that the file names to make its problem")
    verify.add_argument("--rtol", metavar="R", type=_tolerance, default=1e-10, help="of the integrator (default: 1e-10)")
    verify.add_argument("--tolerance", metavar="T", type=_tolerance, help="what points may miss (default: the problem's own, 0.001)")
    verify.add_argument("--workers", metavar="N", type=_workers, default="all", help=WORKERS)


def _add_decide(commands: argparse._SubParsersAction[Parser]) -> None:
    decide = _add(commands, "decide", "choose from a saved front, step by step; in a terminal by commands, else by these options")
    decide.formatter_class = argparse.RawDescriptionHelpFormatter
    decide.epilog = DECIDE
    decide.add_argument("front", metavar="FRONT.nc", help="a front, or a dialogue that --json wrote, which goes on")
    decide.add_argument("--problem", metavar="PROBLEM", help="the problem, for a front that does not name one of `macs list`")
    decide.add_argument("--trust", action="store_true", help="run the code that the file names to make its problem")
    decide.add_argument("--rank-only", action="store_true", help="rank the points that there are; solve nothing")
    decide.add_argument("--transcription", metavar="T", help=TRANSCRIPTION.replace("the problem's own", "a mesh that is found"))
    decide.add_argument("--reference", metavar="NAME=VALUE", action="append", help="come as near as can be to this value; again for others")
    decide.add_argument("--prefer", metavar="FILE.json", help="a preference, as `to_dict` of macs.decisions makes it")
    decide.add_argument("--improve", metavar="NAME", help="then make this objective better than it is")
    decide.add_argument("--to", metavar="VALUE", help="the value to reach (default: the best possible)")
    decide.add_argument("--giving", metavar="OTHER=LIMIT", action="append", help="OTHER may become worse, up to LIMIT; again for others")
    decide.add_argument("--workers", metavar="N", type=_workers, default="all", help=WORKERS)
    decide.add_argument("--alternatives", metavar="K", type=_positive, help="other choices about the one that is made")
    decide.add_argument("--out", metavar="CHOICE.nc", help="save the chosen point as a front")
    decide.add_argument("--json", metavar="CHOICE.json", help="save the choice, and all that led to it: `macs decide CHOICE.json` goes on")
    decide.add_argument("--plot", metavar="FILE.png", help="draw the history: degrees and objectives, turn by turn")


def _add_study(commands: argparse._SubParsersAction[Parser]) -> None:
    study = _add(commands, "study", "batches of runs: make those that are missing, show their state, report on them")
    study.formatter_class = argparse.RawDescriptionHelpFormatter
    study.description = STUDY
    actions = study.add_subparsers(dest="action", metavar="ACTION", required=True, parser_class=Parser)
    run = _add(actions, "run", "make the runs that are missing; the same again resumes where it stopped")
    run.add_argument("study", metavar="STUDY", help="a name of `macs list`, or a TOML file")
    run.add_argument("--out", metavar="DIR", help="the study's folder (default: out/NAME)")
    run.add_argument("--runs", metavar="N", type=_positive, help="number of runs of each cell (default: the study's own)")
    run.add_argument("--jobs", metavar="N", type=_positive, help="processes of this machine that work at a time (default: 1)")
    run.add_argument("--solvers", metavar="LABEL", nargs="+", help="make the runs of these only (default: of all)")
    run.add_argument("--dask", metavar="ADDRESS", help="work on a Dask cluster, such as tcp://10.0.0.1:8786, instead")
    run.add_argument("--retry", action="store_true", help="make runs again, too, that ended with an exception")
    run.add_argument("--fresh", action="store_true", help="repeat finished runs that were made by another version of the code, too")
    run.add_argument("--quick", action="store_true", help="at most 2 runs of 500 evaluations, in a folder of their own (out/NAME-quick)")
    run.add_argument("--trust", action="store_true", help=TRUST)
    status = _add(actions, "status", "how many runs of each cell there are, and why others failed")
    status.add_argument("folder", metavar="DIR")
    report = _add(actions, "report", "tables, statistics and figures of the finished runs, in DIR/report")
    report.add_argument("folder", metavar="DIR")
    report.add_argument("--trust", action="store_true", help=TRUST)
    report.add_argument("--no-figures", action="store_true", help="tables only, which is quicker")
    report.add_argument("--page", metavar="FILE.md", help="also write a page in Markdown, with its pictures beside it")
    report.add_argument("--study", metavar="STUDY", help="with --page: the study's name or file (default: the name in DIR)")
    report.add_argument(
        "--join", metavar="NAME=FILE", action="append", help="a front of another program, CSV or .nc; again for more runs and programs"
    )


def _add_report(commands: argparse._SubParsersAction[Parser]) -> None:
    report = _add(commands, "report", "a front or a study as one page for the browser, a file that loads nothing from the network")
    report.add_argument("source", metavar="FRONT.nc|STUDY", help="a front, a study's folder, or the name of a study that ran into out/NAME")
    report.add_argument("--html", metavar="FILE", help="the page (default: FRONT.html beside the front; DIR/report/report.html of a study)")
    report.add_argument("--trust", action="store_true", help=TRUST)


def _add_serve(commands: argparse._SubParsersAction[Parser]) -> None:
    serve = _add(commands, "serve", "a front or a study as a page of a read-only server on this machine, live while the study runs")
    serve.add_argument("source", metavar="DIR", help="a study's folder or name, a front, or a folder of fronts")
    serve.add_argument("--host", metavar="ADDRESS", default="127.0.0.1", help="0.0.0.0: all can read it (default: only this machine)")
    serve.add_argument("--port", metavar="N", type=_port, default=8642, help="0: any that is free (default: 8642)")
    serve.add_argument("--trust", action="store_true", help=TRUST)


def _add_bench(commands: argparse._SubParsersAction[Parser]) -> None:
    bench = _add(commands, "bench", "ratios against the alternatives, measured side by side in one run")
    bench.formatter_class = argparse.RawDescriptionHelpFormatter
    bench.description = BENCH
    bench.add_argument("what", metavar="KIND", nargs="?", help="one of those above (default: all, which takes hours)")
    bench.add_argument("only", metavar="PROBLEM", nargs="*", help="of corpus and curve: only these, by name or file.py:function")
    bench.add_argument("--problems", metavar="PROBLEM", nargs="+", default=(), help="further ones of the corpus: file.py:function")
    bench.add_argument("--against", metavar="FILE.csv", help="the corpus beside what an earlier run wrote with --csv")
    bench.add_argument(
        "--quick", action="store_true", help="fewer cases, rounds, seeds and evaluations: all within some minutes, with more spread"
    )
    bench.add_argument(
        "--seeds",
        metavar="N",
        type=_positive,
        help="number of seeds of searches (default: 10 on plain functions, 5 for search, 3 for front)",
    )
    bench.add_argument(
        "--jobs",
        metavar="N",
        type=_positive,
        default=1,
        help="runs at the same time, on plain functions: results are the same, but times are no longer those of a machine of its own",
    )
    bench.add_argument(
        "--keep",
        metavar="DIR",
        help="keep searches on plain functions in DIR: killed, or with more --seeds, the same command makes only those that are missing",
    )
    bench.add_argument(
        "--solvers",
        metavar="NAME",
        nargs="+",
        help="only these on plain functions, MACS among them (default: all of the set, which then is judged)",
    )
    bench.add_argument("--csv", metavar="FILE", help="write the measured values to a file too, one number a line")
    bench.add_argument("--page", metavar="FILE.md", help="write the report of a single one as a page too, with the command that made it")


def _unknown_option(word: str, parser: Parser) -> str:
    options = [option for option in parser._option_string_actions if option.startswith("--")]
    near = difflib.get_close_matches(word.split("=")[0], options, n=1)
    if near:
        return f"unknown option {word}; did you mean {near[0]}?"
    return f"unknown argument '{word}'; there are {', '.join(options)}"


def _number(kind: Callable[[str], Any], name: str, fits: Callable[[Any], bool], text: str) -> Any:
    try:
        value = kind(text)
    except ValueError:
        value = None
    if value is None or not fits(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not {name}")
    return value


def _workers(text: str) -> int | str:
    return text if text == "all" else int(_number(int, "all or a whole number above 0", lambda value: value > 0, text))


_positive = partial(_number, int, "a whole number above 0", lambda value: value > 0)
_natural = partial(_number, int, "a whole number, 0 or above", lambda value: value >= 0)
_seconds = partial(_number, float, "a number of seconds above 0", lambda value: 0 < value < float("inf"))
_port = partial(_number, int, "a port, from 0 to 65535", lambda value: 0 <= value <= 65535)
_tolerance = partial(_number, float, "a number above 0", lambda value: 0 < value < float("inf"))


def _verify(text: str) -> float | str:
    return text if text == "none" else float(_tolerance(text))
