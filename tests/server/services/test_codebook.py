"""The codebook explains every column, and the printed page is the codebook."""

import re
from pathlib import Path

import pytest

from server.services import codebook

ROOT = Path(__file__).parents[3]
COLUMNS = [(table, column) for table, columns in codebook.TABLES.items() for column in columns]
UNITS = {"_ms": "ms", "_hz": "Hz", "_px": "CSS px", "_utc": "UTC"}

NAMED_IN_THE_ISSUE = {
    "trials": "study study_version mode participant arm task block role trial trial_id bundle bundle_sha256 "
    "seed started_utc ended_utc outcome success steps progress token cars_at_entry rt_ms_mean rt_ms_median "
    "situation phase route_length token_shown position",
    "steps": "trial_id seq role action rt_ms onset_ms response_ms handler_lag_ms is_trusted refresh_hz row "
    "col messages_heard messages_drawn triangle_max board_px early_keys wait_ms rt_valid",
    "participants": "participant arm role_order token_permutation marketplace device browser viewport "
    "consented_utc finished_utc status completion_code attention_failed excluded exclusion_reason won "
    "bonus_minor currency reward_minor erased",
    "agents": "trial_id seq step seat action token gate cell source",
    "answers": "study study_version mode participant arm form block attempt item value label correct "
    "first_ms last_ms changes answered_utc",
    "probe": "participant arm communication sign position token row column probability best distance least",
    "browser_events": "participant visit seq page kind value at_ms stored_utc",
    "journey": "participant seq event state source stored_utc",
    "flow": "study mode arm stage people",
    "codebook": "table column type unit meaning",
}


@pytest.mark.parametrize("table", NAMED_IN_THE_ISSUE)
def test_every_column_that_was_asked_for_is_there(table: str) -> None:
    assert set(NAMED_IN_THE_ISSUE[table].split()) <= set(codebook.header(table))


@pytest.mark.parametrize("table", codebook.TABLES)
def test_no_column_stands_twice(table: str) -> None:
    names = codebook.header(table)
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(("table", "column"), COLUMNS, ids=lambda value: getattr(value, "name", value))
def test_every_column_has_a_type_a_meaning_and_the_unit_of_its_name(
    table: str, column: codebook.Column
) -> None:
    assert column.type in {"string", "integer", "number", "boolean", "utc"}, table
    assert re.fullmatch(r"[A-Za-z0-9].{14,}\.", column.meaning)
    for suffix, unit in UNITS.items():
        if re.search(rf"{suffix}(_|$)", column.name):
            assert column.unit == unit
    assert (column.type == "utc") == column.name.endswith("_utc")


def test_the_same_name_means_the_same_type_in_every_table() -> None:
    kinds: dict[str, set[str]] = {}
    for _, column in COLUMNS:
        kinds.setdefault(column.name, set()).add(column.type)
    assert {name: kind for name, kind in kinds.items() if len(kind) > 1} == {}


def test_no_column_holds_what_a_marketplace_calls_a_person() -> None:
    names = {column.name for _, column in COLUMNS}
    assert not names & {
        "external_id",
        "external_hash",
        "prolific_pid",
        "worker_id",
        "submission_id",
        "parameters",
    }


def test_the_data_dictionary_is_the_codebook_printed() -> None:
    printed = (ROOT / "docs" / "data-dictionary.md").read_text(encoding="utf-8")
    assert printed == codebook.markdown(), "run: make docs"
