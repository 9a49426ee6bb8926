"""docs/complaints.md keeps up with the tests: whatever it names as accepting a complaint is there."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COMPLAINTS = 18
NAMED = re.compile(r"^- `(tests/[^`:]+)::([^`]+)`$", re.MULTILINE)


def sections() -> list[str]:
    page = (ROOT / "docs/complaints.md").read_text(encoding="utf-8")
    return re.split(r"^## ", page, flags=re.MULTILINE)[1:]


@cache
def written_in(path: str) -> frozenset[str]:
    """Names of the tests of a Python or JavaScript file; none if it is not there."""
    file = ROOT / path
    if not file.is_file():
        return frozenset()
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".mjs":
        return frozenset(re.findall(r'^test\("(.+)", ', text, re.MULTILINE))
    functions = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef))
    return frozenset(each.name for each in functions if each.name.startswith("test_"))


def absent(text: str) -> list[str]:
    return [f"{path}::{name}" for path, name in NAMED.findall(text) if name not in written_in(path)]


def test_every_complaint_has_its_section_in_order() -> None:
    numbers = [int(section.partition(".")[0]) for section in sections()]
    assert numbers == list(range(1, COMPLAINTS + 1))


@pytest.mark.parametrize("section", sections(), ids=lambda text: text.splitlines()[0])
def test_every_complaint_is_accepted_by_tests_that_exist(section: str) -> None:
    assert NAMED.search(section), "names no test"
    assert section.count("::") == len(NAMED.findall(section)), "a line that names a test is malformed"
    assert absent(section) == []


@pytest.mark.parametrize(
    "line",
    [
        "- `tests/architecture/test_complaints.py::test_that_nobody_wrote`",
        "- `tests/nowhere/test_gone.py::test_every_complaint_has_its_section_in_order`",
        "- `tests/static/clock.test.mjs::a clock that runs backwards`",
    ],
)
def test_a_test_that_is_gone_is_noticed(line: str) -> None:
    assert len(absent(line)) == 1
