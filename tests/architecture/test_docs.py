"""The documents keep up with the code: settings, commands, options, targets, links, pictures, tables."""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import typer
from typer.core import TyperGroup

from models import roster
from models.cli import BUNDLES, RECIPES
from models.reproduce import tables
from models.reproduce.cells import Shelf
from models.reproduce.publish import write
from server.cli import app
from server.settings import PACKAGED_BUNDLES, Settings
from server.web import journey_map

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
IMAGES = sorted((ROOT / "docs" / "images").glob("*"))
IMAGE_BYTES_MAX = 140_000
NUMBER = re.compile(
    r"[<≤>≥≈~+−-]?[\d,]*\.?\d+( ?\[[^]]*\])?"
    r"( ?(%|ms|s|min|h|kB|MB|GB|Hz|px|cells|/s|rows/s|actions/s|steps/s))?"
)
COMMAND = re.compile(r"(hatlab|make|python -m|node) \S+")
PRINTED = re.compile(r"^This page is printed by `(python -m|hatlab) \S+.*?`", re.MULTILINE)


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


@cache
def text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@cache
def everything() -> str:
    return "\n".join(text(page) for page in PAGES)


def is_named(words: str) -> bool:
    """Whether some document has these words as such, not only inside longer ones."""
    return re.search(rf"(?<![\w-]){re.escape(words)}(?![\w-])", everything()) is not None


def prose(page: Path) -> str:
    """The page without fenced code."""
    return re.sub(r"^ *```.*?^ *```$", "", text(page), flags=re.DOTALL | re.MULTILINE)


def options() -> Iterator[tuple[str, str]]:
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    context = typer.Context(group)
    for command in group.list_commands(context):
        yield command, ""
        found = group.get_command(context, command)
        for parameter in found.params if found else ():
            yield from ((command, option) for option in parameter.opts if option.startswith("--"))


def targets() -> list[str]:
    return re.findall(r"^([a-z-]+):.*## ", text(ROOT / "Makefile"), flags=re.MULTILINE)


def links(page: Path) -> list[str]:
    found: list[str] = re.findall(r"!?\[[^]]*\]\(([^)\s]+)\)", prose(page))
    return [link for link in found if not re.match(r"[a-z]+:", link)]


def settings_row(start: str) -> str:
    """The line of a table in settings.md that begins with this pattern in code; empty if there is none."""
    row = re.search(rf"^\| `{start}.*$", text(ROOT / "docs/settings.md"), re.MULTILINE)
    return row[0] if row else "|||"


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def sections(page: Path) -> list[str]:
    return re.split(r"^(?=#+ )", text(page), flags=re.MULTILINE)


def measured_cells(section: str) -> list[str]:
    rows = [
        line for line in section.splitlines() if line.startswith("|") and not re.match(r"\|[ :|-]+$", line)
    ]
    cells = [cell.strip().strip("*") for row in rows for cell in row.strip("|").split("|")]
    return [cell for cell in cells if NUMBER.fullmatch(cell)]


@pytest.mark.parametrize("field", sorted(Settings.model_fields))
def test_every_setting_stands_in_the_table_with_its_default(field: str) -> None:
    default = Settings.model_fields[field].default
    said = {PACKAGED_BUNDLES: "models/bundles", None: "none", "": "none"}.get(default, str(default).lower())

    assert said in settings_row(rf"HATLAB_{field.upper()}` \|").split("|")[2]


def test_the_table_names_no_setting_that_is_gone() -> None:
    table = sections(ROOT / "docs/settings.md")[2]
    named = set(re.findall(r"^\| `HATLAB_(\w+)`", table, flags=re.MULTILINE))

    assert named == {field.upper() for field in Settings.model_fields}


def test_every_variable_of_tests_and_builds_is_read_somewhere() -> None:
    table = sections(ROOT / "docs/settings.md")[3]
    named = re.findall(r"`(\w+)`", " ".join(re.findall(r"^\|([^|]+)\|", table, flags=re.MULTILINE)))
    readers = [ROOT / path for path in ("Makefile", "Dockerfile", "compose.yaml", ".ci/need-browser")]
    read = "\n".join(text(path) for path in readers)

    assert named
    assert [each for each in named if not re.search(rf"\b{each}\b", read)] == []


@pytest.mark.parametrize(("command", "option"), sorted(options()))
def test_every_command_and_option_is_documented(command: str, option: str) -> None:
    assert is_named(f"hatlab {command}")
    assert f"`{option}" in settings_row(rf"hatlab {command}\b") or not option


@pytest.mark.parametrize("target", targets())
def test_every_make_target_is_documented(target: str) -> None:
    assert is_named(f"make {target}")


def test_no_document_names_a_target_that_is_gone() -> None:
    assert set(re.findall(r"`make ([a-z-]+)", everything())) <= set(targets())


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_link_and_picture_leads_somewhere(page: Path) -> None:
    for link in links(page):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_file_that_is_named_is_there(page: Path) -> None:
    named = re.findall(r"`((?:models|server|static|tests|docs|benchmarks)/[\w./-]+)`", prose(page))

    assert [path for path in named if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("image", IMAGES, ids=name)
def test_every_picture_is_small_and_shown(image: Path) -> None:
    assert image.stat().st_size <= IMAGE_BYTES_MAX
    assert f"images/{image.name})" in everything()


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_table_of_measured_numbers_says_which_command_printed_it(page: Path) -> None:
    silent = [
        section.splitlines()[0]
        for section in sections(page)
        if len(measured_cells(section)) > 2 and not COMMAND.search(section)
    ]
    assert silent == [] or PRINTED.search(text(page))


def test_the_page_of_agents_is_what_their_evaluations_say() -> None:
    assert text(ROOT / "docs/released-agents.md") == roster.page(), "run `make docs`"


def test_the_page_of_the_journey_is_what_the_code_decides() -> None:
    assert text(ROOT / "docs/journey.md") == journey_map.page(), "run `make docs`"


@pytest.mark.parametrize("name", sorted(path.stem for path in tables.PACKAGED.glob("*.toml")))
def test_every_table_of_the_paper_is_what_the_stored_cells_say(name: str, tmp_path: Path) -> None:
    table = tables.load(name)
    shelf = Shelf(RECIPES, tmp_path, ROOT / "docs/tables/cells", BUNDLES, table.episodes)
    for path in write(table, shelf, tmp_path):
        assert text(ROOT / "docs/tables" / path.name) == text(path), "run `make tables`"


def test_every_decision_is_listed() -> None:
    folder = ROOT / "docs" / "adr"
    listed = set(re.findall(r"\((\d{4}-[\w-]+\.md)\)", text(folder / "README.md")))

    assert listed == {path.name for path in folder.glob("[0-9]*.md")}


def test_a_number_is_told_from_words() -> None:
    section = "# A\n| a | b |\n|---|---:|\n| x | .733 [.726, .739] |\n| y | 12 ms |\n| z | 9 by 9 |\n"
    assert measured_cells(section) == [".733 [.726, .739]", "12 ms"]
