"""SQLite's one writer, shared: threads that write at the same time share a transaction and one wait.

SQLite has one write lock, and with `synchronous=FULL` every commit waits for the disk, some 4 ms. So one
thread after the other takes its turn in an open transaction, each in a savepoint of its own, and whoever
leaves while nobody else wants in commits for all. Nobody's `leave` returns before that commit, so that
nothing is answered that is not durable; a commit that fails, fails for all of them.
"""

import sqlite3
import threading
from contextlib import suppress

from sqlalchemy import Connection, Engine

from server.domain.errors import NotReadyError

TURNS_MAX = 64  # in one transaction, so that a steady stream of writers cannot put the commit off for ever


class Shared:
    """One transaction of several threads."""

    def __init__(self) -> None:
        self.turns = 0
        self.over = threading.Event()
        self.error: BaseException | None = None

    def result(self) -> None:
        """Wait for the commit; raise what it raised."""
        self.over.wait()
        if self.error is not None:
            raise RuntimeError("the transaction that this one was part of failed") from self.error


class SharedWriter:
    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._turn = threading.Lock()
        self._counting = threading.Lock()
        self._waiting = 0
        self._connection: Connection | None = None
        self._shared: Shared | None = None

    def enter(self) -> Connection:
        """Take the turn: the write lock is held and what is read cannot change until `leave`."""
        with self._counting:
            self._waiting += 1
        self._turn.acquire()
        with self._counting:
            self._waiting -= 1
        try:
            return self._begun()
        except BaseException as error:
            self._end(error)
            raise

    def leave(self, *, keep: bool) -> None:
        """Give the turn back, with or without what was written, and wait until it is durable."""
        shared, connection = self._shared, self._connection
        assert shared is not None
        assert connection is not None
        if not keep:
            try:
                raw(connection).execute("ROLLBACK TO turn")
            except BaseException as error:
                self._end(error)
                raise
        shared.turns += 1
        if self._waiting and shared.turns < TURNS_MAX:
            self._turn.release()
        else:
            self._commit(connection)
        if keep:
            shared.result()
        else:
            shared.over.wait()  # what was read in this turn may be another's, and not durable before

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()

    def _begun(self) -> Connection:
        if self._connection is None:
            self._connection = self._engine.connect()
        if self._shared is None:
            self._shared = Shared()
            try:
                raw(self._connection).execute("BEGIN IMMEDIATE")
            except sqlite3.OperationalError as error:
                raise NotReadyError(f"the database takes no writes: {error}") from error
        raw(self._connection).execute("SAVEPOINT turn")  # a later one of the same name covers this one
        return self._connection

    def _commit(self, connection: Connection) -> None:
        try:
            connection.commit()
            raw(connection).commit()  # where nothing went through SQLAlchemy, it has nothing to commit
        except BaseException as error:
            self._end(error)
            raise
        self._end(None)

    def _end(self, error: BaseException | None) -> None:
        """End the transaction for everybody in it and let the next one begin."""
        shared, self._shared = self._shared, None
        if error is not None and self._connection is not None:
            with suppress(Exception):
                self._connection.rollback()
                raw(self._connection).rollback()
        if shared is not None:
            shared.error = error
            shared.over.set()
        self._turn.release()


def raw(connection: Connection) -> sqlite3.Connection:
    """The driver's connection: for a bare word SQLAlchemy costs more than SQLite."""
    driver = connection.connection.driver_connection
    assert isinstance(driver, sqlite3.Connection)
    return driver
