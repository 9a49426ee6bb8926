"""Threads that share a transaction: nobody answers from what is not durable, kept or not."""

import threading
from contextlib import suppress

from server.storage import installation
from server.storage.database import Database

ENOUGH_S, LONG_S = 0.3, 20


def test_who_gives_up_after_reading_another_ones_work_waits_until_that_is_durable(
    sqlite_database: Database,
) -> None:
    """A step refused because of another tab's shows that tab's step: it must not be lost after that."""
    writer = sqlite_database._writer
    assert writer is not None
    may_leave, refused = threading.Event(), threading.Event()
    inside = [threading.Event() for _ in range(2)]

    def keeps() -> None:
        with sqlite_database.writing() as db:
            installation.keep(db, "step", "5")
            inside[0].set()
            wait_for_another()

    def gives_up() -> None:
        inside[0].wait(LONG_S)
        with suppress(LookupError), sqlite_database.writing() as db:
            db.hold()
            assert installation.value(db, "step") == "5"
            inside[1].set()
            wait_for_another()
            raise LookupError
        refused.set()

    def comes_last() -> None:
        inside[1].wait(LONG_S)
        with sqlite_database.writing() as db:
            db.hold()
            may_leave.wait(LONG_S)

    def wait_for_another() -> None:
        while not writer._waiting:
            threading.Event().wait(0.005)

    crowd = [threading.Thread(target=each, daemon=True) for each in (keeps, gives_up, comes_last)]
    for thread in crowd:
        thread.start()
    assert inside[1].wait(LONG_S)
    assert not refused.wait(ENOUGH_S)
    may_leave.set()
    assert refused.wait(LONG_S)
    for thread in crowd:
        thread.join(LONG_S)
    with sqlite_database.reading() as db:
        assert installation.value(db, "step") == "5"
