"""`macs decide`: choosing from a front, by options of the call or command by command in a terminal."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

import transcription
from macs.decisions import Choice, Dialogue, ReferencePoint, from_dict
from macs.decisions.choice import degree_text
from macs.decisions.dialogue_file import is_dialogue, read
from macs.front import Front
from macs.fronts.pictures.front_plot import save_picture
from macs.io.atomic import check_target
from macs.io.text import label, text_table
from problems import Problem
from problems.catalogue import is_catalogued
from problems.checks import unknown
from problems.compiled import Objective

from .answers import DONE, FAILED, WrongCall, wrong_call_on_value_error
from .inputs import check_is_front, check_picture, problem_of, read_json, same_file

PROMPT = "decide> "
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


def decide(arguments: Namespace) -> int:
    """Choose from a front."""
    with wrong_call_on_value_error():
        _check_call(arguments)
        dialogue = _begun(arguments)
        for _ in _asked(dialogue, arguments):
            print(f"{shown(dialogue)}\n")
        choice = dialogue.choose()
    print(shown(dialogue))
    source = dialogue.front.source
    if dialogue.problem is None and source is not None and not source.vector and not arguments.rank_only:
        print(f"The problem '{source.name}' is not at hand: give it by --problem, or --trust the code that the file names.")
    if arguments.alternatives:
        print(f"\n{alternatives_table(dialogue)}")
    wanted = {kind: getattr(arguments, kind) for kind in KINDS if getattr(arguments, kind)}
    if not wanted and sys.stdin.isatty() and sys.stdout.isatty():
        return _loop(dialogue, arguments.front)
    for kind, path in wanted.items():
        print(KINDS[kind](dialogue, path))
    return DONE if good(choice) else FAILED


def good(choice: Choice) -> bool:
    """Whether a choice is feasible, meets all hard limits, and is contradicted by no simulation."""
    return choice.point.status == "converged" and choice.point.verified is not False and bool(np.isfinite(choice.value))


def _check_call(arguments: Namespace) -> None:
    targets = {kind: getattr(arguments, kind) for kind in KINDS if getattr(arguments, kind)}
    for kind, path in targets.items():
        _check_target(kind, path, arguments.front, f"--{kind} ")
    if len({os.path.realpath(path) for path in targets.values()}) < len(targets):
        raise WrongCall(f"{' and '.join(f'--{kind}' for kind in targets)} name the same file")
    if (arguments.to is not None or arguments.giving) and not arguments.improve:
        raise WrongCall("--to and --giving say more about --improve NAME")
    if arguments.prefer and arguments.reference:
        raise WrongCall("give --prefer or --reference, not both")
    if arguments.rank_only and (arguments.problem or arguments.transcription):
        raise WrongCall("--rank-only solves nothing: it takes neither --problem nor --transcription")


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
        problem = _own_problem(front, arguments.trust)
    return Dialogue(front, problem, method)


def _own_problem(front: Front, trust: bool) -> Problem | None:
    """The problem that a front names, if it has dynamics and may be loaded."""
    source = front.source
    if source is None or source.vector or not source.address or not (trust or is_catalogued(source.address)):
        return None
    return source.load()


def _asked(dialogue: Dialogue, arguments: Namespace) -> Iterator[None]:
    """Ask what the options ask for; yields after each turn that another one follows."""
    if arguments.prefer:
        _prefer_file(dialogue, arguments.prefer)
    if arguments.reference:
        _reference(dialogue, ",".join(arguments.reference))
    if arguments.improve:
        goals = dialogue.goals
        name = _name(arguments.improve, goals)
        to = None if arguments.to is None else _value(arguments.to, name, goals)
        giving = _assignments(",".join(arguments.giving or []), goals)
        if arguments.prefer or arguments.reference:
            dialogue.choose()
            yield
        dialogue.improve(name, to, giving)
    if arguments.alternatives:
        dialogue.alternatives(arguments.alternatives)


# The loop


def _loop(dialogue: Dialogue, front: str) -> int:
    """Commands from the terminal."""
    with suppress(ImportError):
        import readline  # noqa: F401 - editing of the line, and earlier ones
    print("\nWhat next? `help` shows the commands.")
    while True:
        try:
            line = input(PROMPT)
        except EOFError:
            print()
            return DONE
        word, _, rest = line.strip().partition(" ")
        if word in ("quit", "exit", "q"):
            return DONE
        if not word:
            continue
        command = _COMMANDS.get(word)
        if command is None:
            print(unknown("command", word, [*_COMMANDS, "quit"]))
            continue
        with _said():
            if word == "save":
                _check_target(_kind(rest), rest.strip(), front, "")
            print(command(dialogue, rest.strip()))


@contextmanager
def _said() -> Iterator[None]:
    """A context in which an error is a line, and Ctrl-C ends what is being done alone."""
    try:
        yield
    except (ValueError, OSError, WrongCall) as error:
        print(" ".join((getattr(error, "strerror", None) or str(error)).split()))
    except KeyboardInterrupt:
        print("interrupted: nothing has changed")


def _show(dialogue: Dialogue, rest: str) -> str:
    return f"{shown(dialogue)}\n\n{dialogue.table()}"


def _prefer(dialogue: Dialogue, rest: str) -> str:
    if not rest:
        raise ValueError("write: prefer NAME=VALUE, ... or prefer FILE.json")
    if "=" in rest and not Path(rest).is_file():
        _reference(dialogue, rest)
    else:
        _prefer_file(dialogue, rest)
    return _chosen(dialogue)


def _improve(dialogue: Dialogue, rest: str) -> str:
    goals = dialogue.goals
    words, _, given = rest.partition(" giving ")
    name, to = words.strip(), None
    if name not in [goal.name for goal in goals] and " to " in words:
        name, _, text = words.rpartition(" to ")
        name = name.strip()
        to = _value(text, _name(name, goals), goals)
    dialogue.improve(_name(name, goals), to, _assignments(given, goals))
    return shown(dialogue)


def _alternatives(dialogue: Dialogue, rest: str) -> str:
    if rest and not rest.isdecimal():
        raise ValueError(f"'{rest}' is no number of alternatives")
    dialogue.alternatives(*([int(rest)] if rest else []))
    return alternatives_table(dialogue)


def _take(dialogue: Dialogue, rest: str) -> str:
    if not rest.isdecimal():
        raise ValueError("write: take NUMBER, of an alternative")
    dialogue.take(int(rest))
    return shown(dialogue)


def _undo(dialogue: Dialogue, rest: str) -> str:
    dialogue.undo()
    return shown(dialogue) if dialogue.history else "Back at the beginning: nothing is chosen."


def _save(dialogue: Dialogue, rest: str) -> str:
    return KINDS[_kind(rest)](dialogue, rest)


def _kind(path: str) -> str:
    """What a file is to hold, by its suffix."""
    suffix = Path(path.strip()).suffix.lower()
    if not suffix:
        raise ValueError("write: save FILE.json, FILE.nc or FILE.png")
    return {".json": "json", ".nc": "out"}.get(suffix, "plot")


_COMMANDS: dict[str, Callable[[Dialogue, str], str]] = {
    "help": lambda dialogue, rest: HELP,
    "show": _show,
    "reference": _prefer,
    "prefer": _prefer,
    "improve": _improve,
    "alternatives": _alternatives,
    "take": _take,
    "undo": _undo,
    "save": _save,
}


def _chosen(dialogue: Dialogue) -> str:
    """What is to be shown of a choice that is made now; what was asked for is forgotten if it fails."""
    try:
        dialogue.choose()
    except BaseException:
        dialogue.undo()
        raise
    return shown(dialogue)


# Words


def _name(text: str, goals: Sequence[Objective]) -> str:
    names = [goal.name for goal in goals]
    if text.strip() not in names:
        raise ValueError(unknown("objective", text.strip(), names))
    return text.strip()


def _value(text: str, name: str, goals: Sequence[Objective]) -> float:
    """A number, with or without the unit of the objective."""
    unit = next(goal.unit for goal in goals if goal.name == name)
    bare = text.strip()
    bare = bare.removesuffix(unit).strip() if unit else bare
    try:
        return float(bare)
    except ValueError:
        raise ValueError(f"'{text.strip()}' is no value of '{name}'{f' in {unit}' if unit else ''}") from None


def _assignments(text: str, goals: Sequence[Objective]) -> dict[str, float]:
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
    given = _assignments(text, dialogue.goals)
    units = {goal.name: goal.unit for goal in dialogue.goals}
    words = ", ".join(f"{name} {value:g}{f' {units[name]}' if units[name] else ''}" for name, value in given.items())
    dialogue.prefer(ReferencePoint(given), f"near {words}")


def _prefer_file(dialogue: Dialogue, path: str) -> None:
    data = read_json(path)
    try:
        dialogue.prefer(from_dict(data))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


# Output


def shown(dialogue: Dialogue) -> str:
    """The ranges, the present choice with its degrees, and what it costs."""
    choice, goals = dialogue.choose(), dialogue.goals
    ranges, J = dialogue.ranges, choice.objectives
    turn = next(turn for turn in reversed(dialogue.history) if turn.choice is choice)
    rows = [
        [
            goal.name,
            f"{goal.sense[:3]} [{goal.unit or '-'}]",
            *(f"{value:.6g}" for value in (J[goal.name], ranges.best[goal.name], ranges.worst[goal.name])),
            degree_text(choice.degrees[goal.name]),
        ]
        for goal in goals
    ]
    table = text_table([["objective", "", "chosen", "best", "worst", "degree"]], rows, [True, True, *[False] * 4])
    told = {True: "verified", False: "not verified", None: "not simulated"}[choice.point.verified]
    lines = [f"Turn {len(dialogue.history)}: {turn.asked} ({choice.point.status}, {told})", "", table]
    lines += [f"degrees: {choice.preference.DEGREE}", "", costs(choice)]
    return "\n".join([*lines, *(["", f"{choice.message[0].upper()}{choice.message[1:]}"] if choice.message else [])])


def costs(choice: Choice) -> str:
    """What each objective would cost the others, from the weights that the point has."""
    goals, weights = choice.point.goals, choice.point.weights
    if len(goals) < 2:
        return "There is one objective: it costs no other."
    found = choice.trade_offs
    if weights is None or found is None:
        return "What more of one objective costs the others is not known: this point has no weights."
    rates = found.rates
    titles = ["one unit better in", *(label(goal.name, goal.unit) for goal in goals)]
    rows = [
        [label(goal.name, goal.unit), *("" if k == i else _cost(-goal.sign * rates[k, i]) for k in range(len(goals)))]
        for i, goal in enumerate(goals)
    ]
    return text_table([titles, ["changes, along the front", *[""] * len(goals)]], rows, [True, *[False] * len(goals)])


def _cost(value: float) -> str:
    return f"{value + 0.0:+.4g}" if np.isfinite(value) else "-"


def alternatives_table(dialogue: Dialogue) -> str:
    """The alternatives, numbered, with the degrees by what is asked for at present."""
    found, goals = dialogue.alternatives_found, dialogue.goals
    if not found:
        return "No other choice was found about the present one."
    titles = ["alternative", *(goal.name for goal in goals), *["degree"] * len(goals)]
    units = ["", *(f"{goal.sense[:3]} [{goal.unit or '-'}]" for goal in goals), *(goal.name for goal in goals)]
    rows = [
        [str(k + 1), *(f"{value:.6g}" for value in one.objectives.values()), *(degree_text(one.degrees[goal.name]) for goal in goals)]
        for k, one in enumerate(found)
    ]
    return text_table([titles, units], rows, [False] * len(titles))


def _save_out(dialogue: Dialogue, path: str) -> str:
    Front.of(dialogue.choose().point.alone()).save(path)
    return f"chosen point in {path}"


def _save_json(dialogue: Dialogue, path: str) -> str:
    dialogue.save(path)
    return f"dialogue in {path}; `macs decide {path}` goes on with it"


def _save_plot(dialogue: Dialogue, path: str) -> str:
    save_picture(dialogue, path)
    return f"picture in {path}"


KINDS: dict[str, Callable[[Dialogue, str], str]] = {"out": _save_out, "json": _save_json, "plot": _save_plot}
"""What is written of a dialogue, by the option that names the file."""
