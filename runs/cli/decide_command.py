"""`macs decide`: choosing from a front, by options of the call or command by command in a terminal."""

from __future__ import annotations

import cmd
import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import transcription
from macs.decisions import Choice, Dialogue, ReferencePoint, from_dict
from macs.decisions.choice import choices_table
from macs.decisions.dialogue import own_problem
from macs.decisions.dialogue_file import is_dialogue, read
from macs.front import Front
from macs.fronts.pictures.front_plot import save_picture
from macs.io.atomic import check_target
from problems.checks import unknown
from problems.compiled import Objective

from .answers import DONE, FAILED, WrongCall, wrong_call_on_value_error
from .inputs import check_is_front, check_picture, problem_of, read_json, same_file

HELP = """\
show                                      ranges, the present choice, what it costs, and the history
reference NAME=VALUE, ...                 come as near as can be to these values (also: prefer NAME=VALUE, ...)
prefer FILE.json                          a preference as Python's `to_dict` writes it
improve NAME [to VALUE] [giving OTHER=LIMIT, ...]
                                          make one better than it is; others may become worse, those of `giving` until their limits
alternatives [K]                          other choices about the present one
take NUMBER                               make an alternative the present choice
undo                                      forget the last turn
save FILE.json | FILE.nc | FILE.png       the dialogue, to go on with later; the chosen point as a front; the history as a picture
quit                                      the end (also: Ctrl-D)"""
FILES = ("out", "json", "plot")
"""Options that name a file that is written."""


def decide(arguments: Namespace) -> int:
    """Choose from a front."""
    with wrong_call_on_value_error():
        wanted = _check_call(arguments)
        dialogue = _begun(arguments)
        asked = _improvement(arguments, dialogue.goals)
        if arguments.prefer:
            _prefer_file(dialogue, arguments.prefer)
        elif arguments.reference:
            _reference(dialogue, ",".join(arguments.reference))
        if asked is not None:
            if arguments.prefer or arguments.reference:
                print(f"{shown(dialogue)}\n")
            dialogue.improve(*asked)
        choice = dialogue.choose()
        if arguments.alternatives:
            dialogue.alternatives(arguments.alternatives)
    print(shown(dialogue))
    source = dialogue.front.source
    if dialogue.problem is None and source is not None and not source.vector and not arguments.rank_only:
        print(f"The problem '{source.name}' is not at hand: give it by --problem, or --trust the code that the file names.")
    if arguments.alternatives:
        print(f"\n{_alternatives(dialogue)}")
    if not wanted and sys.stdin.isatty() and sys.stdout.isatty():
        Commands(dialogue, arguments.front).cmdloop()
        return DONE
    for kind, path in wanted.items():
        print(_saved(dialogue, kind, path))
    return DONE if good(choice) else FAILED


def good(choice: Choice) -> bool:
    """Whether a choice is feasible, meets all hard limits, and is contradicted by no simulation."""
    return choice.point.status == "converged" and choice.point.verified is not False and bool(np.isfinite(choice.value))


def _check_call(arguments: Namespace) -> dict[str, str]:
    """The files that are wanted, by their option; raises what is wrong with the options before any work."""
    wanted = {kind: getattr(arguments, kind) for kind in FILES if getattr(arguments, kind)}
    for kind, path in wanted.items():
        _check_target(kind, path, arguments.front, f"--{kind} ")
    if len({os.path.realpath(path) for path in wanted.values()}) < len(wanted):
        raise WrongCall(f"{' and '.join(f'--{kind}' for kind in wanted)} name the same file")
    if (arguments.to is not None or arguments.giving) and not arguments.improve:
        raise WrongCall("--to and --giving say more about --improve NAME")
    if arguments.prefer and arguments.reference:
        raise WrongCall("give --prefer or --reference, not both")
    if arguments.rank_only and (arguments.problem or arguments.transcription):
        raise WrongCall("--rank-only solves nothing: it takes neither --problem nor --transcription")
    return wanted


def _check_target(kind: str, path: str, front: str, option: str) -> None:
    """Raise what is wrong with a file that is to be written, before anything is."""
    check_target(path)
    file = Path(path)
    if same_file(path, front) and not (kind == "json" and is_dialogue(front)):
        raise WrongCall(f"{option}{path} would overwrite what the choice is made from")
    if kind == "out":
        check_is_front(file, option)
    elif kind == "plot":
        check_picture(path)
    elif file.is_file() and file.stat().st_size and not is_dialogue(path):
        raise WrongCall(f"{option}{path} would overwrite a file that is no dialogue")


def _begun(arguments: Namespace) -> Dialogue:
    """The dialogue of a file, or a new one about a front."""
    path = arguments.front
    method = None if arguments.transcription is None else transcription.parse(arguments.transcription)
    if Path(path).is_file() and is_dialogue(path):
        if method is not None:
            raise WrongCall("--transcription is for a new dialogue: this one has its own")
        problem = None if arguments.problem is None else problem_of(read(path)[1].source, arguments.problem)
        dialogue = Dialogue.load(path, problem, arguments.trust)
        if arguments.rank_only:
            dialogue.problem = None
        return dialogue
    front = Front.load(path, trust=arguments.trust)
    problem = None if arguments.problem is None else problem_of(front.source, arguments.problem)
    if front.source is None and problem is not None:
        raise WrongCall(f"{path} is a front of a black box: it has no problem")
    if problem is None and not arguments.rank_only:
        problem = own_problem(front, arguments.trust)
    return Dialogue(front, problem, method)


def _improvement(arguments: Namespace, goals: Sequence[Objective]) -> tuple[str, float | None, dict[str, float]] | None:
    """What `--improve` asks for, and how much, at whose cost."""
    if not arguments.improve:
        return None
    name = _name(arguments.improve, goals)
    to = None if arguments.to is None else _value(arguments.to, name, goals)
    return name, to, assignments(",".join(arguments.giving or []), goals)


class Commands(cmd.Cmd):
    """A dialogue in a terminal: each line is a command, and an error is one line."""

    intro, prompt = "\nWhat next? `help` shows the commands.", "decide> "

    def __init__(self, dialogue: Dialogue, front: str) -> None:
        super().__init__()
        self.dialogue, self.front = dialogue, front

    def onecmd(self, line: str) -> bool:
        """Whether the dialogue ends; Ctrl-C ends what is being done alone."""
        try:
            return bool(super().onecmd(line))
        except (ValueError, OSError, WrongCall) as error:
            print(" ".join((getattr(error, "strerror", None) or str(error)).split()))
        except KeyboardInterrupt:
            print("interrupted: nothing has changed")
        return False

    def emptyline(self) -> bool:
        return False

    def default(self, line: str) -> None:
        known = [name.removeprefix("do_") for name in self.get_names() if name.startswith("do_") and name != "do_EOF"]
        print(unknown("command", line.split()[0], known))

    def do_help(self, arg: str) -> None:
        print(HELP)

    def do_show(self, arg: str) -> None:
        print(f"{shown(self.dialogue)}\n\n{self.dialogue.table()}")

    def do_prefer(self, arg: str) -> None:
        if not arg:
            raise ValueError("write: prefer NAME=VALUE, ... or prefer FILE.json")
        if "=" in arg and not Path(arg).is_file():
            _reference(self.dialogue, arg)
        else:
            _prefer_file(self.dialogue, arg)
        print(shown(self.dialogue))

    do_reference = do_prefer

    def do_improve(self, arg: str) -> None:
        goals = self.dialogue.goals
        words, _, given = arg.partition(" giving ")
        name, to = words.strip(), None
        if name not in [goal.name for goal in goals] and " to " in words:
            name, _, text = words.rpartition(" to ")
            to = _value(text, _name(name, goals), goals)
        self.dialogue.improve(_name(name, goals), to, assignments(given, goals))
        print(shown(self.dialogue))

    def do_alternatives(self, arg: str) -> None:
        if arg and not arg.isdecimal():
            raise ValueError(f"'{arg}' is no number of alternatives")
        self.dialogue.alternatives(*([int(arg)] if arg else []))
        print(_alternatives(self.dialogue))

    def do_take(self, arg: str) -> None:
        if not arg.isdecimal():
            raise ValueError("write: take NUMBER, of an alternative")
        self.dialogue.take(int(arg))
        print(shown(self.dialogue))

    def do_undo(self, arg: str) -> None:
        self.dialogue.undo()
        print(shown(self.dialogue) if self.dialogue.history else "Back at the beginning: nothing is chosen.")

    def do_save(self, arg: str) -> None:
        suffix = Path(arg).suffix.lower()
        if not suffix:
            raise ValueError("write: save FILE.json, FILE.nc or FILE.png")
        kind = {".json": "json", ".nc": "out"}.get(suffix, "plot")
        _check_target(kind, arg, self.front, "")
        print(_saved(self.dialogue, kind, arg))

    def do_quit(self, arg: str) -> bool:
        return True

    do_exit = do_q = do_quit

    def do_EOF(self, arg: str) -> bool:
        print()
        return True


# Words


def _name(text: str, goals: Sequence[Objective]) -> str:
    names = [goal.name for goal in goals]
    if text.strip() not in names:
        raise ValueError(unknown("objective", text.strip(), names))
    return text.strip()


def _value(text: str, name: str, goals: Sequence[Objective]) -> float:
    """A number, with or without the unit of the objective."""
    unit = next(goal.unit for goal in goals if goal.name == name)
    try:
        return float(text.strip().removesuffix(unit))
    except ValueError:
        raise ValueError(f"'{text.strip()}' is no value of '{name}'{f' in {unit}' if unit else ''}") from None


def assignments(text: str, goals: Sequence[Objective]) -> dict[str, float]:
    """{name: value} of "NAME=VALUE, NAME=VALUE", of which names may have commas."""
    parts: list[str] = []
    for part in text.split(",") if text.strip() else []:
        # What has no value yet goes on after the comma.
        parts[-1:] = [f"{parts[-1]},{part}"] if parts and "=" not in parts[-1] else [*parts[-1:], part]
    found: dict[str, float] = {}
    for part in parts:
        name, equals, value = part.rpartition("=")
        if not equals:
            raise ValueError(f"'{part.strip()}': write NAME=VALUE")
        name = _name(name, goals)
        if name in found:
            raise ValueError(f"'{name}' is given twice")
        found[name] = _value(value, name, goals)
    return found


def _reference(dialogue: Dialogue, text: str) -> None:
    given = assignments(text, dialogue.goals)
    units = {goal.name: goal.unit for goal in dialogue.goals}
    words = ", ".join(f"{name} {value:g} {units[name]}".rstrip() for name, value in given.items())
    dialogue.choose(ReferencePoint(given), f"near {words}{', others at their best' if len(given) < len(units) else ''}")


def _prefer_file(dialogue: Dialogue, path: str) -> None:
    data = read_json(path)
    try:
        dialogue.choose(from_dict(data))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


# Output


def shown(dialogue: Dialogue) -> str:
    """The ranges, the present choice with its degrees, and what it costs."""
    choice = dialogue.choose()
    turn = next(turn for turn in reversed(dialogue.history) if turn.choice is choice)
    told = {True: "verified", False: "not verified", None: "not simulated"}[choice.point.verified]
    lines = [f"Turn {len(dialogue.history)}: {turn.asked} ({choice.point.status}, {told})", "", choice.degrees_table()]
    lines += [f"degrees: {choice.preference.DEGREE}", "", _costs(choice)]
    return "\n".join([*lines, *(["", f"{choice.message[0].upper()}{choice.message[1:]}"] if choice.message else [])])


def _costs(choice: Choice) -> str:
    """What each objective would cost the others, from the weights that the point has."""
    if len(choice.point.goals) < 2:
        return "There is one objective: it costs no other."
    if choice.point.weights is None or choice.trade_offs is None:
        return "What more of one objective costs the others is not known: this point has no weights."
    return choice.trade_offs.rates_table()


def _alternatives(dialogue: Dialogue) -> str:
    """The alternatives, numbered, with the degrees by what is asked for at present."""
    found = dialogue.alternatives_found
    if not found:
        return "No other choice was found about the present one."
    return choices_table(dialogue.goals, {"alternative": [str(k + 1) for k in range(len(found))]}, found, found[0])


def _saved(dialogue: Dialogue, kind: str, path: str) -> str:
    """What is said of a file that is written: the dialogue, the chosen point, or the history as a picture."""
    if kind == "out":
        Front.of(dialogue.choose().point.alone()).save(path)
        return f"chosen point in {path}"
    if kind == "json":
        dialogue.save(path)
        return f"dialogue in {path}; `macs decide {path}` goes on with it"
    save_picture(dialogue, path)
    return f"picture in {path}"
