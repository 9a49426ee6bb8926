import threading
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from sqlalchemy import func, select

from server.domain.errors import ClosedError, NotReadyError
from server.storage import events, installation, studies
from server.storage.database import Database
from server.storage.events import EventRow
from server.storage.tables import event, metadata


def test_the_migrations_make_exactly_the_tables(database: Database) -> None:
    with database.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_a_database_is_current_only_after_its_migrations(tmp_path: Path) -> None:
    database = Database(f"sqlite:///{tmp_path}/deep/new.sqlite3")
    assert not database.is_current()
    database.upgrade()
    assert database.is_current()
    database.upgrade()
    database.close()


def test_an_empty_postgres_is_not_current(database: Database) -> None:
    with database.engine.begin() as connection:
        connection.exec_driver_sql("DROP TABLE alembic_version")
    assert not database.is_current()


@pytest.mark.parametrize(
    "url",
    [
        "mysql://host/db",
        "sqlite://",
        "sqlite:///:memory:",
        "not a url",
        "sqlite+aiosqlite:///x.db",
        "postgresql://h:port/d",
    ],
)
def test_a_url_that_cannot_be_used_is_refused_in_one_line(url: str) -> None:
    with pytest.raises(NotReadyError) as caught:
        Database(url)
    assert "\n" not in caught.value.detail
    assert "HATLAB_DATABASE_URL" in caught.value.detail


def test_a_plain_postgres_url_gets_our_driver_and_its_password_is_not_shown() -> None:
    database = Database("postgresql://someone:secret@127.0.0.1:1/db")
    assert database.url.drivername == "postgresql+psycopg"
    assert "secret" not in database.shown_url
    with pytest.raises(NotReadyError, match="cannot be used"):
        database.is_current()


def test_a_file_that_is_no_database_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("a letter to somebody")
    database = Database(f"sqlite:///{file}")
    for ask in (database.is_current, database.upgrade):
        with pytest.raises(NotReadyError, match="file is not a database"):
            ask()
    assert file.read_text() == "a letter to somebody"


def test_a_database_of_a_newer_hatlab_is_refused_and_left_as_it_is(database: Database) -> None:
    with database.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    assert not database.is_current()
    with pytest.raises(NotReadyError, match="newer"):
        database.upgrade()


def test_sqlite_survives_power_loss_by_its_settings(sqlite_database: Database) -> None:
    as_served = Database(f"sqlite:///{sqlite_database.url.database}")
    with as_served.engine.connect() as connection:
        asked = ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
        found = [connection.exec_driver_sql(f"PRAGMA {name}").scalar_one() for name in asked]
    as_served.close()
    assert found == ["wal", 2, 1, 10_000]


def test_what_a_block_wrote_is_there_for_others_once_it_ends(database: Database) -> None:
    with database.writing() as db:
        installation.keep(db, "a", "1")
        with database.reading() as other:
            assert installation.value(other, "a") is None
    with database.reading() as other:
        assert installation.value(other, "a") == "1"


def test_an_error_takes_everything_back_and_frees_the_lock(database: Database) -> None:
    def fail() -> None:
        with database.writing() as db:
            installation.keep(db, "a", "1")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    with database.writing() as db:
        assert installation.value(db, "a") is None
        installation.keep(db, "a", "2")


def test_a_reading_transaction_sees_one_moment_and_cannot_write(database: Database) -> None:
    with database.reading() as db:
        assert studies.every(db) == []
        with database.writing() as other:
            studies.add(other, "s", "S", "test", "", "2026-01-01T00:00:00.000Z")
        assert studies.every(db) == []
        with pytest.raises(RuntimeError):
            installation.keep(db, "a", "1")


def test_the_write_lock_is_taken_at_the_first_write_and_not_before(sqlite_database: Database) -> None:
    with sqlite_database.writing() as early:
        assert installation.value(early, "a") is None
        with sqlite_database.writing() as other:
            installation.keep(other, "a", "1")
        early.hold()
        assert installation.value(early, "a") == "1"


def test_writers_wait_for_each_other_and_none_is_lost(database: Database) -> None:
    with database.writing() as db:
        study = studies.add(db, "s", "S", "test", "", "2026-01-01T00:00:00.000Z")

    def launch(name: str) -> None:
        for _ in range(5):
            with database.writing() as db:
                studies.hold(db, study)
                studies.add_version(db, study, name, "", "")

    threads = [threading.Thread(target=launch, args=(str(n),)) for n in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with database.reading() as db:
        assert [version.number for version in studies.versions(db, study)] == list(range(1, 31))


def test_two_processes_wait_for_each_other_too(sqlite_database: Database) -> None:
    other = Database(f"sqlite:///{sqlite_database.url.database}")
    done = threading.Event()

    def write() -> None:
        with other.writing() as db:
            installation.keep(db, "b", "2")
        done.set()

    with sqlite_database.writing() as db:
        installation.keep(db, "a", "1")
        thread = threading.Thread(target=write)
        thread.start()
        assert not done.wait(0.2)
    thread.join()
    assert done.is_set()
    other.close()


def test_an_event_without_its_trial_is_refused(database: Database) -> None:
    with pytest.raises(ClosedError), database.writing() as db:
        events.append(db, EventRow("nowhere", 0, "{}", "", ""))
    with database.reading() as db:
        assert db.read(select(func.count()).select_from(event)).scalar_one() == 0
