"""The code that a result depends on: digests of the modules that it may run, found by what each imports. Comments, docstrings and
formatting are no code. A name that a package only passes on is followed to the module that defines it."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path

FLOORS = Path(__file__).parents[2]
"""The folder of the packages."""
SOLVING = ("problems", "transcription", "macs")
"""Those whose code decides a result; what `runs` measures of it can be measured again."""
SHOWING = [f"macs.fronts.{one}" for one in ("pictures", "tables", "spreadsheets", "files", "dataset", "columns")]
SHOWING += [f"macs.{one}" for one in ("preferences.pictures", "solvers.progress", "io.console", "io.text", "io.netcdf", "io.atomic")]
"""Modules that only show or store a result."""
NAMING = ("problems.catalogue", "transcription.catalogue")
"""Modules that find others by a name: which these are, a study's cells say."""
BY_GRADIENTS = ("macs.gradients", "macs.refinement", "macs.gradient_tools")
"""What calls and fronts can do, but baselines on a given transcription, and searches without one, never do."""
UNKNOWN, SEVERAL = "unknown", "+"
"""In place of a module and its digest where no code was recorded; between several digests of one module."""
Code = Mapping[str, str]
"""{module: digest of its code}."""


def code_of(seeds: Collection[str], without: Sequence[str] = ()) -> dict[str, str]:
    """The modules that these may run, themselves included, each with the digest of its code; none of those that begin with `without`."""
    left = (*SHOWING, *NAMING, *without)
    found: dict[str, str] = {}
    todo = [seed for seed in seeds if seed.split(".")[0] in SOLVING]
    while todo:
        module = todo.pop()
        if module not in found and not any(f"{module}.".startswith(f"{one}.") for one in left):
            path = _path(module)
            if path.name != "__init__.py" and path.exists():
                found[module] = digest_of_file(path)
                todo += [_defining(*one) for one in _imports(path)]
    return dict(sorted(found.items()))


@cache
def code_of_method(problem: str, transcription: str, solver: str) -> Code:
    """The code of a run, from the modules of its problem, transcription and solver; that of a vector problem has no transcription."""
    flying = transcription.split(".")[0] in SOLVING
    seeds = [problem, solver, *([transcription, "transcription.inner.levels"] if flying else [])]
    by_values = not flying or solver.startswith("macs.baselines")
    return code_of(seeds, [*([] if flying else ["transcription"]), *(BY_GRADIENTS if by_values else [])])


def imported(files: Sequence[Path]) -> list[str]:
    """The modules of the floors below that files of `runs` import."""
    return [_defining(*one) for file in files if file.is_relative_to(FLOORS / "runs") for one in _imports(file)]


def code_of_measures() -> dict[str, str]:
    """The code that makes numbers of the fronts of runs."""
    files = sorted((FLOORS / "runs" / "measures").glob("*.py"))
    return {f"runs.measures.{one.stem}": digest_of_file(one) for one in files}


def merged(several: Iterable[Code]) -> dict[str, str]:
    """The code of several runs. Where they are by more than one, a module has several digests; where it is not known, it is "unknown"."""
    found: dict[str, set[str]] = {}
    for code in several:
        for module, digest in (code or {UNKNOWN: UNKNOWN}).items():
            found.setdefault(module, set()).add(digest)
    return {module: SEVERAL.join(sorted(digests)) for module, digests in sorted(found.items())}


def digest_of_code(code: Code) -> str:
    """One digest of all modules; empty for none, of which nothing is known."""
    return _short(repr(sorted(code.items()))) if code else ""


def rooms(code: Code) -> dict[str, str]:
    """{folder of modules: digest of those in it}; of cases each module is one."""
    by_room: dict[str, dict[str, str]] = {}
    for module, digest in code.items():
        room = module if module.startswith("problems.cases.") else module.rpartition(".")[0] or module
        by_room.setdefault(room, {})[module] = digest
    return {room: digest_of_code(own) for room, own in sorted(by_room.items())}


def changed(one: Code, other: Code) -> list[str]:
    """The modules, or rooms, that are in one of two alone or differ."""
    return sorted({name for name in {*one, *other} if one.get(name) != other.get(name)})


@cache
def digest_of_file(path: Path) -> str:
    """That of the code in it, without comments and docstrings."""
    return _short(" ".join(_words(_tree(path))))


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _words(node: ast.AST) -> list[str]:
    """What a syntax tree says: the same in all versions of Python, which add fields that are empty."""
    found = [type(node).__name__]
    for name, value in ast.iter_fields(node):
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, ast.AST):
                if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant)):  # docstrings are such
                    found += [name, *_words(one)]
            elif one is not None:
                found += [name, repr(one)]
    return found


@cache
def _imports(path: Path) -> list[tuple[str, str, str]]:
    """(module, name in it, name here) of each import from the floors, but those for type checkers."""
    package = path.parent.relative_to(FLOORS).parts
    found, todo = [], list[ast.AST](_tree(path).body)
    while todo:
        node = todo.pop()
        if isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else ()
            module = ".".join([*above, *([node.module] if node.module else [])])
            found += [(module, one.name, one.asname or one.name) for one in node.names if module.split(".")[0] in SOLVING]
        elif not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
            todo += ast.iter_child_nodes(node)
    return found


def _defining(module: str, name: str, _: str = "") -> str:
    """The module that a name of a module is, or is defined in."""
    inside = f"{module}.{name}"
    if _path(inside).exists():
        return inside
    passed_on = _imports(_path(module)) if _path(module).name == "__init__.py" else []
    return next((_defining(*one) for one in passed_on if one[2] == name), module)


def _path(module: str) -> Path:
    """The file of a module, or that of a package."""
    place = FLOORS.joinpath(*module.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
