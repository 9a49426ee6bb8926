"""Threads that write at once share a transaction: nobody's rows are lost, nobody else's error costs them."""

import threading
from collections.abc import Callable
from time import monotonic

import pytest
from sqlalchemy import event as hooks

from server.domain.errors import NotReadyError
from server.storage import installation
from server.storage.database import Database


def together(*calls: Callable[[], None]) -> list[BaseException | None]:
    """Run in threads; what each raised."""
    raised: list[BaseException | None] = [None] * len(calls)

    def run(index: int) -> None:
        try:
            calls[index]()
        except BaseException as error:  # noqa: BLE001 (handed to the test)
            raised[index] = error

    threads = [threading.Thread(target=run, args=(index,)) for index in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return raised


def keys(database: Database) -> set[str]:
    with database.reading() as db:
        rows = db.connection.exec_driver_sql("SELECT key FROM installation")
        return {key for (key,) in rows}


def writer(
    database: Database, name: str, gate: threading.Event, *, fails: bool = False
) -> Callable[[], None]:
    def write() -> None:
        gate.wait()
        with database.writing() as db:
            installation.keep(db, name, "1")
            if fails:
                raise KeyError(name)

    return write


def test_writers_that_queue_up_share_a_commit_and_all_rows_are_there(sqlite_database: Database) -> None:
    gate = threading.Event()
    turns = []

    def slow() -> None:
        with sqlite_database.writing() as db:
            installation.keep(db, "slow", "1")
            gate.set()
            threading.Event().wait(0.5)  # the others queue up meanwhile
            assert sqlite_database._writer is not None
            turns.append(sqlite_database._writer._shared)

    names = [f"w{n}" for n in range(20)]
    assert together(slow, *(writer(sqlite_database, name, gate) for name in names)) == [None] * 21
    assert keys(sqlite_database) == {"slow", *names}
    assert turns[0] is not None
    assert turns[0].turns > 5


def test_an_error_in_one_turn_takes_back_that_turn_only(sqlite_database: Database) -> None:
    gate = threading.Event()
    gate.set()
    calls = [writer(sqlite_database, f"w{n}", gate, fails=n % 3 == 0) for n in range(18)]
    raised = together(*calls)
    assert [type(error) for error in raised] == [KeyError if n % 3 == 0 else type(None) for n in range(18)]
    assert keys(sqlite_database) == {f"w{n}" for n in range(18) if n % 3}


def test_a_statement_that_the_database_refuses_costs_only_its_own_turn(sqlite_database: Database) -> None:
    from sqlalchemy.exc import IntegrityError

    gate = threading.Event()
    gate.set()
    same = [writer(sqlite_database, "same", gate) for _ in range(5)]
    others = [writer(sqlite_database, f"w{n}", gate) for n in range(5)]
    raised = together(*same, *others)
    assert sum(isinstance(error, IntegrityError) for error in raised[:5]) == 4
    assert raised[5:] == [None] * 5
    assert keys(sqlite_database) == {"same", *(f"w{n}" for n in range(5))}


def test_a_commit_that_fails_fails_for_all_and_the_next_one_works(
    sqlite_database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    with sqlite_database.writing() as db:
        installation.keep(db, "before", "1")
    shared = sqlite_database._writer
    assert shared is not None
    assert shared._connection is not None
    broken = threading.Event()

    def fail() -> None:
        broken.set()
        raise OSError("disk full")

    with monkeypatch.context() as patch:
        patch.setattr(shared._connection, "commit", fail)
        gate = threading.Event()
        gate.set()
        raised = together(*(writer(sqlite_database, f"w{n}", gate) for n in range(6)))
    assert broken.is_set()
    assert all(isinstance(error, OSError | RuntimeError) for error in raised)
    assert keys(sqlite_database) == {"before"}
    with sqlite_database.writing() as db:
        installation.keep(db, "after", "1")
    assert keys(sqlite_database) == {"before", "after"}


def test_nothing_returns_before_it_is_durable(sqlite_database: Database) -> None:
    """Right after every block another connection sees the row."""
    gate = threading.Event()
    gate.set()
    unseen = []

    def check(name: str) -> Callable[[], None]:
        write = writer(sqlite_database, name, gate)

        def run() -> None:
            for round_ in range(5):
                with sqlite_database.writing() as db:
                    installation.keep(db, f"{name}-{round_}", "1")
                if f"{name}-{round_}" not in keys(sqlite_database):
                    unseen.append(name)
            write()

        return run

    assert together(*(check(f"w{n}") for n in range(12))) == [None] * 12
    assert unseen == []


def test_a_database_that_stays_locked_is_an_error_and_not_a_hang(sqlite_database: Database) -> None:
    other = Database(f"sqlite:///{sqlite_database.url.database}")
    hooks.listen(
        sqlite_database.engine, "connect", lambda connection, _: connection.execute("PRAGMA busy_timeout=50")
    )
    gate = threading.Event()
    gate.set()
    with other.writing() as db:
        installation.keep(db, "other", "1")
        began = monotonic()
        raised = together(*(writer(sqlite_database, f"w{n}", gate) for n in range(4)))
        assert monotonic() - began < 5
    assert all(isinstance(error, NotReadyError) for error in raised)
    other.close()
    with sqlite_database.writing() as db:
        installation.keep(db, "mine", "1")
    assert keys(sqlite_database) == {"other", "mine"}
