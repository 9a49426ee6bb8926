"""One database, SQLite or PostgreSQL, and the transactions on it.

`reading()` sees one snapshot. `writing()` commits when its block ends without an error, and nobody else
commits. On SQLite a writing transaction takes the one write lock at its first write (`BEGIN IMMEDIATE`) and
not before, so that a decision can be computed without keeping others waiting; whoever must decide on what was
read takes the lock first (`DbSession.hold`). SQLite runs with WAL and `synchronous=FULL`: what is
acknowledged survives power loss.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from alembic.util import CommandError
from sqlalchemy import (
    Connection,
    CursorResult,
    Engine,
    Executable,
    QueuePool,
    create_engine,
    event,
    make_url,
)
from sqlalchemy.engine import URL
from sqlalchemy.exc import ArgumentError, DatabaseError

from server.domain.errors import NotReadyError
from server.storage.shared_writer import SharedWriter

MIGRATIONS = Path(__file__).parents[2] / "migrations"
BUSY_TIMEOUT_MS = 10_000
CONNECTIONS = 45  # more than the 40 threads in which Starlette runs `def` routes, and the writer's
Rows = Mapping[str, Any] | Sequence[Mapping[str, Any]]


class DbSession:
    """One transaction, handed through the services to the query modules."""

    def __init__(self, connection: Connection, writer: SharedWriter | None, *, writable: bool) -> None:
        self.connection = connection
        self._writer = writer
        self._writable = writable
        self._held = False

    def read(self, statement: Executable, rows: Rows | None = None) -> CursorResult[Any]:
        return self.connection.execute(statement, rows)

    def write(self, statement: Executable, rows: Rows | None = None) -> CursorResult[Any]:
        self.hold()
        return self.connection.execute(statement, rows)

    def hold(self) -> None:
        """Take SQLite's write lock now: what is read from here on cannot change before the commit.

        PostgreSQL has no such lock; there a query module locks the row it decides on (`studies.hold`).
        """
        if not self._writable:
            raise RuntimeError("a reading() transaction was asked to write")
        if self._writer is not None and not self._held:
            self.connection = self._writer.enter()
            self._held = True

    def release(self, *, keep: bool) -> None:
        if self._writer is not None and self._held:
            self._held = False
            self._writer.leave(keep=keep)


class Database:
    """The engine of one URL.

    Raises:
        NotReadyError: the URL cannot be used.
    """

    def __init__(self, url: str) -> None:
        self.url = parsed(url)
        self.is_sqlite = self.url.get_backend_name() == "sqlite"
        self.engine = engine_of(self.url)
        self._snapshots = self.engine
        if not self.is_sqlite:
            self._snapshots = self.engine.execution_options(
                isolation_level="REPEATABLE READ", postgresql_readonly=True
            )
        self._writer = SharedWriter(self.engine) if self.is_sqlite else None

    @contextmanager
    def reading(self) -> Iterator[DbSession]:
        with self._snapshots.connect() as connection:
            if self.is_sqlite:
                connection.exec_driver_sql("BEGIN")
            yield DbSession(connection, None, writable=False)

    @contextmanager
    def writing(self) -> Iterator[DbSession]:
        with self.engine.connect() as connection:
            db = DbSession(connection, self._writer, writable=True)
            try:
                yield db
            except BaseException:
                connection.rollback()
                db.release(keep=False)
                raise
            connection.commit()
            db.release(keep=True)

    def is_current(self) -> bool:
        """Whether every migration has been run. False for an empty or missing database."""
        if self.is_sqlite and self.url.database and not Path(self.url.database).exists():
            return False
        try:
            with self.engine.connect() as connection:
                current = MigrationContext.configure(connection).get_current_heads()
        except DatabaseError as error:
            raise self._unusable(error) from error
        return set(current) == set(ScriptDirectory.from_config(alembic_config()).get_heads())

    def upgrade(self) -> None:
        """Run the migrations that are missing. Creates the folder of an SQLite file."""
        if self.is_sqlite and self.url.database:
            Path(self.url.database).parent.mkdir(parents=True, exist_ok=True)
        config = alembic_config()
        try:
            with self.engine.begin() as connection:
                if self.is_sqlite:
                    connection.exec_driver_sql("BEGIN IMMEDIATE")  # a migration happens whole or not at all
                config.attributes["connection"] = connection
                command.upgrade(config, "head")
        except DatabaseError as error:
            raise self._unusable(error) from error
        except CommandError as error:
            raise NotReadyError(
                f"database {self.shown_url} was migrated by another hatlab, perhaps a newer one: {error}"
            ) from error

    def settle(self) -> None:
        """SQLite: empty the log into the file, so that what was deleted stands in neither.

        Does what it can while others read. PostgreSQL's autovacuum does the same in its own time.
        """
        if self.is_sqlite:
            with self.engine.connect() as connection:
                connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")

    def _unusable(self, error: DatabaseError) -> NotReadyError:
        return NotReadyError(f"database {self.shown_url} cannot be used: {error.orig}")

    @property
    def shown_url(self) -> str:
        return self.url.render_as_string(hide_password=True)

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
        self.engine.dispose()


def parsed(url: str) -> URL:
    try:
        given = make_url(url)
    except (ArgumentError, ValueError) as error:  # the latter for a port that is no number
        raise NotReadyError("HATLAB_DATABASE_URL is not a database URL") from error
    if given.drivername in {"postgresql", "postgres", "postgresql+psycopg"}:
        return given.set(drivername="postgresql+psycopg")
    if given.drivername in {"sqlite", "sqlite+pysqlite"} and given.database not in {None, "", ":memory:"}:
        return given
    raise NotReadyError(
        f"HATLAB_DATABASE_URL: use sqlite:///file or postgresql://…, not {given.drivername}://"
    )


def engine_of(url: URL) -> Engine:
    engine = create_engine(url, poolclass=QueuePool, pool_size=CONNECTIONS, max_overflow=0)
    if url.get_backend_name() == "sqlite":
        event.listen(engine, "connect", prepare_sqlite)
    return engine


def prepare_sqlite(connection: Any, _record: object) -> None:
    connection.isolation_level = None  # the driver begins nothing on its own; hold() and reading() do
    for pragma in (
        f"busy_timeout={BUSY_TIMEOUT_MS}",
        "journal_mode=WAL",
        "synchronous=FULL",
        "foreign_keys=ON",
        "secure_delete=ON",  # what is erased is overwritten in the file, not only unlinked
    ):
        connection.execute(f"PRAGMA {pragma}")


def alembic_config() -> Config:
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    return config
