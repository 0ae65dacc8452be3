"""The weight of the house and the size of its rooms: a folder reads as a table of contents, a file has one idea (docs/architecture.md)."""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from macs import MACS

ROOT = Path(__file__).parents[1]
FLOORS = ("problems", "transcription", "macs", "runs")
MODULES = [path for floor in FLOORS for path in sorted((ROOT / floor).rglob("*.py"))]
ROOMS = [path for path in MODULES if path.name not in ("__init__.py", "__main__.py")]
TESTS = list((ROOT / "tests").rglob("*.py"))
LINES, CODE, OF_TESTS = 53_747, 31_914, 36_197
"""Most lines of the floors, lines of their code, and lines of the tests: what there is, to go down to 40,000, 25,000 and 28,000.
What raises one of them says so in the changelog."""
TWICE = {"MACS"}
"""Class names that two classes may have: that of pymoo's interface is the search's."""


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def lines(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def code(path: Path) -> int:
    """Lines without blanks, comments, docstrings and imports."""
    nodes = [
        node
        for node in ast.walk(tree(path))
        if isinstance(node, ast.Import | ast.ImportFrom)
        or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str))
    ]
    left = {number for node in nodes for number in range(node.lineno, (node.end_lineno or 0) + 1)}
    text = path.read_text(encoding="utf-8").splitlines()
    return sum(bool(line.strip()) and not line.strip().startswith("#") for number, line in enumerate(text, 1) if number not in left)


def is_number(value: ast.expr | None) -> bool:
    """Whether this is a number, an expression of numbers, or a tuple of these."""
    match value:
        case ast.Constant():
            return isinstance(value.value, int | float) and not isinstance(value.value, bool)
        case ast.UnaryOp():
            return is_number(value.operand)
        case ast.BinOp():
            return is_number(value.left) and is_number(value.right)
        case ast.Tuple() | ast.List():
            return bool(value.elts) and all(map(is_number, value.elts))
    return False


def named_numbers(path: Path) -> Iterator[tuple[str, str]]:
    """Name and value of each number of a module."""
    for node in tree(path).body:
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target if isinstance(node, ast.AnnAssign) else None
        value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
        together = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
        pairs = zip(target.elts, value.elts, strict=True) if together else [(target, value)]
        for name, one in pairs:
            if isinstance(name, ast.Name) and is_number(one):
                yield name.id, ast.unparse(one)


def classes() -> Iterator[tuple[Path, ast.ClassDef]]:
    for path in MODULES:
        yield from ((path, node) for node in ast.walk(tree(path)) if isinstance(node, ast.ClassDef))


def is_case(path: Path) -> bool:
    return path.is_relative_to(ROOT / "problems" / "cases")


def test_no_folder_has_more_than_14_modules():
    counts = Counter(path.parent.relative_to(ROOT) for path in ROOMS)
    assert {str(folder): count for folder, count in counts.items() if count > 14} == {}


def test_modules_have_one_idea():
    sizes = {str(path.relative_to(ROOT)): lines(path) for path in ROOMS}
    assert {name: count for name, count in sizes.items() if not 80 <= count <= 700} == {}


def test_the_weight_of_floors_and_tests_and_the_count_of_numbers_with_a_name():
    assert sum(map(lines, TESTS)) <= OF_TESTS
    assert sum(map(lines, MODULES)) <= LINES
    assert sum(map(code, MODULES)) <= CODE
    assert len(ROOMS) <= 300
    numbers = [number for path in ROOMS if not is_case(path) for number in named_numbers(path)]
    fields = sum(
        isinstance(node, ast.AnnAssign) and is_number(node.value)
        for path, one in classes()
        if not is_case(path) and any("dataclass" in ast.unparse(each) for each in one.decorator_list)
        for node in one.body
    )
    assert len(numbers) <= 200
    assert len(numbers) + fields <= 400
    values = defaultdict(set)
    for name, value in numbers:
        values[name].add(value)
    assert {name: found for name, found in values.items() if len(found) > 1} == {}, "a number has one value"
    counts = Counter(one.name for _, one in classes())
    assert {name for name, count in counts.items() if count > 1} <= TWICE, "a class name is one idea"


def test_macs_has_few_settings():
    assert len(MACS.__dataclass_fields__) <= 12
