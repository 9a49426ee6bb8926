"""docs/privacy.md leaves no table out, and says of each truly whether it goes with a person."""

import re
from pathlib import Path

import pytest

from server.storage.erasure import DATA
from server.storage.tables import event, metadata, participant

PAGE = Path(__file__).parents[2] / "docs" / "privacy.md"
BESIDE = {"submission", "identity"}
"""Deleted with the person, without depending on the participant's row."""


def listed() -> dict[str, str]:
    """What the page says of deleting, by table."""
    section = PAGE.read_text(encoding="utf-8").split("## Every table")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \|[^|]*\|[^|]*\|([^|]*)\|$", section, re.MULTILINE)
    return {str(name): str(deleted).strip() for name, deleted in rows}


def goes_with_a_person(name: str) -> bool:
    """Whether the row ends with its participant, by the keys of the tables."""
    table = metadata.tables[name]
    cascading = {
        key.column.table.name
        for column in table.columns
        for key in column.foreign_keys
        if key.ondelete == "CASCADE"
    }
    return table is participant or name in BESIDE or bool(cascading & {"participant", "trial"})


def test_every_table_is_listed_and_no_other() -> None:
    assert set(listed()) == set(metadata.tables)


@pytest.mark.parametrize("name", sorted(metadata.tables))
def test_what_goes_with_a_person_is_said_to_go(name: str) -> None:
    assert listed()[name].startswith("with the person") == goes_with_a_person(name)


@pytest.mark.parametrize("name", sorted(metadata.tables))
def test_what_goes_by_withdrawing_is_said_to_go(name: str) -> None:
    deleted = {table.name for table in (*DATA, event)}

    assert listed()[name].endswith("by withdrawing") == (name in deleted)
