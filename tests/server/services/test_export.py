"""An export is complete, consistent, in order, safe to open, and says what it is."""

import csv
import hashlib
import io
import json
import tracemalloc
import zipfile
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from benchmarks import synthetic
from benchmarks.rounds_only import ROUNDS_ONLY
from server.domain import canonical
from server.domain.errors import BadInputError, NotFoundError
from server.domain.study import read
from server.services import codebook, studies
from server.services.export import export, stream_zip
from server.services.lab import Lab
from server.settings import Settings
from server.storage.database import Database
from tests.server.services.steps import launch

ASKED = {"answers", "probe", "browser_events", "journey"}
"""Tables that made-up people have no rows in; see test_export_answers."""
NOW = datetime(2026, 1, 2, 4, 0, tzinfo=UTC)
TABLES = (*codebook.TABLES, "codebook")


def prepared(database: Database) -> Lab:
    """A lab with two launched studies and a clock that stands still."""
    settings = Settings(database_url=database.url.render_as_string(hide_password=False))
    lab = Lab(settings, database, {}, (), "s" * 40, now=lambda: NOW)
    for name, slug in (("parent-child", "signs"), ("traffic-junction", "cars")):
        values = {**studies.template(name), **ROUNDS_ONLY, "slug": slug, "trials_per_block": 3}
        launch(lab, read(values))
    return lab


@pytest.fixture
def lab(database: Database) -> Lab:
    return prepared(database)


def tables(folder: Path) -> dict[str, list[dict[str, str]]]:
    def read_table(name: str) -> list[dict[str, str]]:
        with (folder / f"{name}.csv").open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    return {name: read_table(name) for name in TABLES}


def exported(
    lab: Lab, slug: str, folder: Path, *modes: str, **options: Any
) -> dict[str, list[dict[str, str]]]:
    export(lab, slug, modes, folder, **options)
    return tables(folder)


@pytest.mark.parametrize("slug", ["signs", "cars"])
def test_every_file_has_the_header_of_the_codebook(lab: Lab, tmp_path: Path, slug: str) -> None:
    synthetic.fill(lab, slug, 2)
    export(lab, slug, (), tmp_path / "out")
    for table in TABLES:
        first = (tmp_path / "out" / f"{table}.csv").read_bytes().split(b"\r\n")[0].decode()
        assert first.split(",") == codebook.header(table)
    explained = [(row["table"], row["column"]) for row in tables(tmp_path / "out")["codebook"]]
    assert explained == [(t, c) for t in codebook.TABLES for c in codebook.header(t)]


@pytest.mark.parametrize("slug", ["signs", "cars"])
def test_the_keys_join_and_nothing_stands_twice(lab: Lab, tmp_path: Path, slug: str) -> None:
    steps = synthetic.fill(lab, slug, 3)
    found = exported(lab, slug, tmp_path / "out")
    people = [row["participant"] for row in found["participants"]]
    trials = [row["trial_id"] for row in found["trials"]]
    decisions = [(row["trial_id"], int(row["seq"])) for row in found["steps"]]
    agents = [(r["trial_id"], int(r["seq"]), int(r["step"]), int(r["seat"])) for r in found["agents"]]
    assert people == sorted(set(people))
    assert trials == sorted(set(trials))
    assert decisions == sorted(set(decisions))
    assert agents == sorted(set(agents))
    assert len(people) == 3
    assert len(decisions) == steps
    assert {row["participant"] for row in found["trials"]} == set(people)
    assert {trial for trial, _ in decisions} == set(trials)
    assert {(trial, seq) for trial, seq, _, _ in agents} == set(decisions)
    assert {r["trial_id"]: int(r["decisions"]) for r in found["trials"]} == {
        trial: sum(of == trial for of, _ in decisions) for trial in trials
    }


@pytest.mark.parametrize("slug", ["signs", "cars"])
def test_every_cell_is_of_the_type_that_the_codebook_names(lab: Lab, tmp_path: Path, slug: str) -> None:
    synthetic.fill(lab, slug, 2)
    found = exported(lab, slug, tmp_path / "out", practice=True)
    readers = {
        "integer": int,
        "number": float,
        "string": str,
        "boolean": {"true": True, "false": False}.__getitem__,
        "utc": canonical.utc_moment,
    }
    for table, columns in codebook.TABLES.items():
        assert found[table] or table in ASKED
        for column in columns:
            for row in found[table]:
                if row[column.name] != "":
                    readers[column.type](row[column.name])


def test_the_manifest_counts_and_hashes_every_file(lab: Lab, tmp_path: Path) -> None:
    synthetic.fill(lab, "signs", 2)
    given = export(lab, "signs", (), tmp_path / "out")
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest == given
    assert set(manifest["files"]) == {f"{table}.csv" for table in TABLES}
    for name, facts in manifest["files"].items():
        data = (tmp_path / "out" / name).read_bytes()
        assert facts["sha256"] == hashlib.sha256(data).hexdigest()
        assert facts["bytes"] == len(data)
        assert facts["rows"] == len(list(csv.reader(io.StringIO(data.decode(), newline="")))) - 1
    assert manifest["study"] == "signs"
    assert manifest["modes"] == ["live"]
    assert manifest["practice"] is False
    assert manifest["exported_utc"] == "2026-01-02T04:00:00.000Z"
    assert [version["number"] for version in manifest["study_versions"]] == [1]


def test_the_zip_holds_the_same_bytes_and_begins_before_it_is_complete(lab: Lab, tmp_path: Path) -> None:
    synthetic.fill(lab, "cars", 3)
    export(lab, "cars", (), tmp_path / "out")
    pieces = list(stream_zip(lab, "cars", ()))
    assert len(pieces) > len(TABLES)
    archive = zipfile.ZipFile(io.BytesIO(b"".join(pieces)))
    assert archive.testzip() is None
    names = [f"{table}.csv" for table in TABLES] + ["manifest.json"]
    assert archive.namelist() == [f"cars/{name}" for name in names]
    for name in names:
        assert archive.read(f"cars/{name}") == (tmp_path / "out" / name).read_bytes()


def test_only_live_people_are_exported_unless_others_are_asked_for(lab: Lab, tmp_path: Path) -> None:
    for first, mode in ((0, "live"), (10, "test"), (20, "robot"), (30, "preview")):
        synthetic.fill(lab, "signs", 2, first=first, mode=mode)
    assert {row["mode"] for row in exported(lab, "signs", tmp_path / "a")["participants"]} == {"live"}
    both = exported(lab, "signs", tmp_path / "b", "robot", "test")
    assert {row["mode"] for row in both["participants"]} == {"robot", "test"}
    assert {row["mode"] for row in both["trials"]} == {"robot", "test"}
    people = {row["participant"] for row in both["participants"]}
    assert {row["participant"] for row in both["steps"]} == people
    assert {row["trial_id"].split("-")[0] for row in both["agents"]} == people


def test_practice_comes_only_when_asked_for(lab: Lab, tmp_path: Path) -> None:
    synthetic.fill(lab, "signs", 1)
    without = exported(lab, "signs", tmp_path / "a")
    assert {row["phase"] for row in [*without["trials"], *without["steps"]]} == {"main"}
    with_it = exported(lab, "signs", tmp_path / "b", practice=True)
    assert {row["phase"] for row in with_it["trials"]} == {"main", "practice"}
    assert len(with_it["trials"]) == len(without["trials"]) + 2


def test_another_studys_people_stay_out(lab: Lab, tmp_path: Path) -> None:
    synthetic.fill(lab, "signs", 1)
    synthetic.fill(lab, "cars", 1, first=50)
    found = exported(lab, "cars", tmp_path / "out")
    assert {row["participant"] for row in found["participants"]} == {"P0000000050"}
    assert next(row["people"] for row in found["flow"] if row["stage"] == "consented") == "1"
    assert {row["participant"] for row in found["trials"]} == {"P0000000050"}


def test_no_worker_id_of_a_marketplace_is_anywhere_in_an_export(lab: Lab, tmp_path: Path) -> None:
    synthetic.fill(lab, "signs", 2)
    with lab.database.reading() as db:
        outside = synthetic.enrolments.identity_of(db, "P0000000001")
    export(lab, "signs", (), tmp_path / "out", practice=True)
    everything = b"".join(path.read_bytes() for path in (tmp_path / "out").iterdir())
    assert outside.external_id.startswith("marketplace-")
    assert outside.external_id.encode() not in everything
    assert outside.external_hash.encode() not in everything


def test_what_a_browser_says_about_itself_cannot_run_in_a_spreadsheet(lab: Lab, tmp_path: Path) -> None:
    synthetic.fill(lab, "signs", 1, browser="=HYPERLINK(1)", device="@a", viewport='1,"2"\r\n3')
    [row] = exported(lab, "signs", tmp_path / "out")["participants"]
    assert row["browser"] == "'=HYPERLINK(1)"
    assert row["device"] == "'@a"
    assert row["viewport"] == '1,"2"\r\n3'


def test_whoever_was_not_heard_of_for_longer_than_the_lease_has_abandoned(lab: Lab, tmp_path: Path) -> None:
    heard = {"long": NOW - timedelta(minutes=61), "just": NOW - timedelta(minutes=59)}
    for first, moment in enumerate(heard.values()):
        seen = canonical.utc_text(moment)
        synthetic.fill(lab, "signs", 1, first=first, status="active", finished_utc=None, last_seen_utc=seen)
    found = exported(lab, "signs", tmp_path / "out")["participants"]
    assert [row["status"] for row in found] == ["abandoned", "active"]
    assert [row["finished_utc"] for row in found] == ["", ""]


def test_an_empty_study_gives_empty_tables(lab: Lab, tmp_path: Path) -> None:
    found = exported(lab, "signs", tmp_path / "out")
    counts = {name: len(rows) for name, rows in found.items() if name not in {"codebook", "flow"}}
    assert set(counts.values()) == {0}
    assert {row["people"] for row in found["flow"]} == {"0", ""}


def test_two_exports_of_the_same_data_are_the_same_bytes(lab: Lab, tmp_path: Path) -> None:
    synthetic.fill(lab, "cars", 3)
    assert export(lab, "cars", (), tmp_path / "a") == export(lab, "cars", (), tmp_path / "b")


def test_all_tables_show_the_same_moment_while_people_go_on(lab: Lab) -> None:
    synthetic.fill(lab, "signs", 2)
    pieces = stream_zip(lab, "signs", ())
    first = next(pieces)
    synthetic.fill(lab, "signs", 2, first=10)
    archive = zipfile.ZipFile(io.BytesIO(first + b"".join(pieces)))
    text = archive.read("signs/participants.csv") + archive.read("signs/steps.csv")
    assert b"P0000000001" in text
    assert b"P0000000010" not in text


def test_what_cannot_be_exported_is_refused_before_anything_is_written(lab: Lab, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(NotFoundError, match="no study is called nothing"):
        export(lab, "nothing", (), out)
    with pytest.raises(BadInputError, match="unknown mode alive: use live, test, preview, robot"):
        export(lab, "signs", ("alive",), out)
    with pytest.raises(NotFoundError):
        stream_zip(lab, "nothing", ())
    assert not out.exists()


def test_a_folder_with_something_in_it_is_left_alone(lab: Lab, tmp_path: Path) -> None:
    (tmp_path / "kept.txt").write_text("mine")
    with pytest.raises(BadInputError, match="is not an empty folder"):
        export(lab, "signs", (), tmp_path)
    with pytest.raises(BadInputError, match="is not an empty folder"):
        export(lab, "signs", (), tmp_path / "kept.txt")
    assert (tmp_path / "kept.txt").read_text() == "mine"


def test_a_place_that_cannot_be_written_to_is_named(lab: Lab, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(BadInputError, match=r"cannot write to .*inside: Not a directory"):
        export(lab, "signs", (), tmp_path / "file" / "inside")


def test_memory_does_not_grow_with_the_number_of_people(
    sqlite_database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = prepared(sqlite_database)
    monkeypatch.setattr("server.services.export.PEOPLE_A_PAGE", 2)
    monkeypatch.setattr("server.services.sheets.ROWS_A_PIECE", 100)

    def peak_bytes() -> int:
        tracemalloc.start()
        for _ in stream_zip(lab, "signs", ()):
            pass
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    synthetic.fill(lab, "signs", 6)
    for _ in stream_zip(lab, "signs", ()):  # fill the caches that are filled once
        pass
    few = peak_bytes()
    synthetic.fill(lab, "signs", 24, first=6)
    assert peak_bytes() < few * 1.25


def test_a_study_of_a_hundred_and_sixty_people_is_exported_whole(
    sqlite_database: Database, tmp_path: Path
) -> None:
    lab = prepared(sqlite_database)
    synthetic.fill(lab, "cars", 160)
    found = exported(lab, "cars", tmp_path / "out")
    people = {row["participant"] for row in found["participants"]}
    assert len(found["participants"]) == len(people) == 160
    assert {row["participant"] for row in found["trials"]} == people
    assert len(found["trials"]) == 160 * 3
