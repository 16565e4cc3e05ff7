"""Functions are short, and a class or file is found by its name alone."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.documentation.command_line import FUNCTIONS

ROOT = Path(__file__).parents[2]
PACKAGES = ("solver", "ensemble", "api")
LINES, ARGUMENTS = 60, 7
COMMANDS = {function.__name__ for function in FUNCTIONS}  # whose arguments are the options of a command

# What Python, pytest and the three packages' structure name.
_USUAL_NAMES = {"__init__.py", "__main__.py", "env.py"}


def sources() -> list[Path]:
    """All modules of the packages, without the revisions of the database's schema."""
    paths = (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))
    return [path for path in paths if "migrations" not in path.parts]


def functions() -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    """All functions of the packages, with where they are."""
    for path in sources():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield f"{path.relative_to(ROOT)}:{node.lineno} {node.name}", node


def _is_compiled(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    return any("compiled" in ast.unparse(decorator) for decorator in node.decorator_list)


def _line_count(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines from the name to the end, without the docstring."""
    has_docstring = ast.get_docstring(node) is not None
    docstring = _lines(node.body[0]) if has_docstring else 0
    return _lines(node) - docstring


def _lines(node: ast.stmt) -> int:
    assert node.end_lineno is not None
    return node.end_lineno - node.lineno + 1


def test_functions_are_short() -> None:
    assert not [
        f"{name}: {count} lines" for name, node in functions() if (count := _line_count(node)) > LINES
    ]


def test_functions_take_few_arguments() -> None:
    assert not [
        f"{name}: {count} arguments"
        for name, node in functions()
        if (count := _argument_count(node)) > ARGUMENTS
        and not _is_compiled(node)
        and node.name not in COMMANDS
    ]


def _argument_count(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


def test_public_classes_have_names_of_their_own() -> None:
    names = Counter(
        node.name
        for path in sources()
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert not [name for name, count in names.items() if count > 1]


def test_files_have_names_of_their_own() -> None:
    names = Counter(path.name for path in sources() if path.name not in _USUAL_NAMES)
    assert not [name for name, count in names.items() if count > 1]
