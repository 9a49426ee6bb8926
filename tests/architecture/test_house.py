"""The house rules that no linter knows: sizes, names, where the environment is read."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted(p for top in ("models", "server") for p in (ROOT / top).rglob("*.py"))
LINES_MAX = 600
FUNCTION_LINES_MAX = 70
# Read top to bottom on purpose (STYLE.md allows a training loop to be longer).
LONG_FUNCTIONS: set[str] = set()


def functions(path: Path) -> Iterator[tuple[str, int]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield f"{path.relative_to(ROOT)}:{node.name}", (node.end_lineno or node.lineno) - node.lineno + 1


def test_the_sources_are_found() -> None:
    assert len(SOURCES) > 40


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_module_is_longer_than_one_thought(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= LINES_MAX


def test_no_function_is_longer_than_a_page() -> None:
    long = {name: lines for path in SOURCES for name, lines in functions(path) if lines > FUNCTION_LINES_MAX}
    assert set(long) <= LONG_FUNCTIONS, long


def test_no_file_is_a_drawer_for_everything() -> None:
    assert not {p.stem for p in SOURCES} & {"utils", "helpers", "common", "manager", "misc"}


def test_the_environment_is_read_in_settings_only() -> None:
    readers = [
        str(path.relative_to(ROOT))
        for path in SOURCES
        if any(
            isinstance(node, ast.Attribute) and node.attr in {"environ", "getenv"}
            for node in ast.walk(ast.parse(path.read_text()))
        )
    ]
    assert readers == []


def test_every_package_says_what_it_is() -> None:
    silent = [
        str(path.relative_to(ROOT))
        for path in SOURCES
        if path.name != "__init__.py" and ast.get_docstring(ast.parse(path.read_text())) is None
    ]
    assert silent == []
