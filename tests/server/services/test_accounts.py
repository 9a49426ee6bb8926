"""Accounts on SQLite and PostgreSQL: the brake on guessing holds whoever counts."""

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path

import pytest
from argon2 import PasswordHasher
from pydantic import SecretStr
from sqlalchemy import select

from server.domain.errors import BadInputError
from server.services import accounts
from server.services.accounts import SignedIn, Wait, WrongPassword
from server.services.lab import Lab
from server.storage import admins
from server.storage.database import Database
from server.storage.tables import admin, admin_session, login_attempt
from tests.fakes import FakeClock, another_worker, fake_lab

PASSWORD = "correct horse"


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


@pytest.fixture
def lab(database: Database, clock: FakeClock, monkeypatch: pytest.MonkeyPatch) -> Lab:
    """With a hash that takes no time: these tests are about counting."""
    quick = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr(accounts, "hasher", lambda: quick)
    made = fake_lab(database, clock=clock)
    with database.writing() as db:
        accounts.create_admin(db, "Ada ", PASSWORD)
    return made


def signed_in(lab: Lab, key: str) -> str | None:
    with lab.database.reading() as db:
        found = accounts.session(db, lab, key)
    return found.username if found else None


def attempts(lab: Lab) -> int:
    with lab.database.reading() as db:
        return len(db.read(select(login_attempt)).all())


def fail(lab: Lab, times: int, username: str = "ada", source: str = "1.2.3.4") -> list[object]:
    return [accounts.login(lab, username, "wrong", source) for _ in range(times)]


def test_the_right_password_opens_a_session_for_any_spelling_of_the_name(lab: Lab) -> None:
    for name in ("ada", " ADA "):
        result = accounts.login(lab, name, PASSWORD, "1.2.3.4")
        assert isinstance(result, SignedIn)
        assert signed_in(lab, result.key) == "ada"


def test_neither_password_nor_session_key_is_stored(lab: Lab) -> None:
    result = accounts.login(lab, "ada", PASSWORD, "1.2.3.4")
    assert isinstance(result, SignedIn)
    with lab.database.reading() as db:
        stored = str([db.read(select(table)).all() for table in (admin, admin_session, login_attempt)])
    assert PASSWORD not in stored
    assert result.key not in stored
    assert "$argon2id$" in stored


def test_a_wrong_password_and_an_unknown_name_get_the_same_answer(lab: Lab) -> None:
    assert fail(lab, 1) == fail(lab, 1, "nobody") == [WrongPassword()]


def test_an_unknown_name_costs_a_hash_too(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []
    original = accounts.matches
    monkeypatch.setattr(accounts, "matches", lambda h, p: (seen.append(h), original(h, p))[1])
    fail(lab, 1, "nobody")
    assert seen == [accounts.nobody()]


def test_the_sixth_attempt_waits_whoever_answers_it(lab: Lab) -> None:
    assert fail(lab, 5) == [WrongPassword()] * 5
    for worker in (lab, another_worker(lab)):
        result = accounts.login(worker, "ada", PASSWORD, "1.2.3.4")
        assert isinstance(result, Wait)
        assert 890 <= result.seconds <= 900
    assert attempts(lab) == 5


def test_after_the_wait_the_right_password_works(lab: Lab, clock: FakeClock) -> None:
    fail(lab, 5)
    waiting = accounts.login(lab, "ada", PASSWORD, "1.2.3.4")
    assert isinstance(waiting, Wait)
    clock.now += timedelta(seconds=waiting.seconds - 5)
    assert isinstance(accounts.login(lab, "ada", PASSWORD, "1.2.3.4"), Wait)
    clock.now += timedelta(seconds=10)
    assert isinstance(accounts.login(lab, "ada", PASSWORD, "1.2.3.4"), SignedIn)


def test_a_success_forgives_the_failures_before_it(lab: Lab) -> None:
    fail(lab, 4)
    assert isinstance(accounts.login(lab, "ada", PASSWORD, "1.2.3.4"), SignedIn)
    assert fail(lab, 5) == [WrongPassword()] * 5
    assert isinstance(fail(lab, 1)[0], Wait)


def test_another_source_may_still_sign_in(lab: Lab) -> None:
    fail(lab, 5)
    assert isinstance(accounts.login(lab, "ada", PASSWORD, "5.6.7.8"), SignedIn)


def test_a_source_that_tries_many_names_is_stopped(lab: Lab) -> None:
    for number in range(20):
        assert fail(lab, 1, f"name-{number}") == [WrongPassword()]
    assert isinstance(fail(lab, 1, "name-20")[0], Wait)


def test_a_name_that_many_sources_try_is_stopped(lab: Lab) -> None:
    for number in range(50):
        assert fail(lab, 1, source=f"10.0.0.{number}") == [WrongPassword()]
    assert isinstance(fail(lab, 1, source="10.0.1.0")[0], Wait)


def test_guesses_at_once_do_not_slip_past_the_limit(lab: Lab) -> None:
    workers = [another_worker(lab) for _ in range(12)]
    with ThreadPoolExecutor(12) as pool:
        results = list(pool.map(lambda worker: fail(worker, 1)[0], workers))
    looked_at = sum(result == WrongPassword() for result in results)
    assert looked_at <= 5
    assert looked_at + sum(isinstance(result, Wait) for result in results) == 12
    assert attempts(lab) == looked_at


def test_a_session_ends_at_its_time_and_when_it_is_signed_out(lab: Lab, clock: FakeClock) -> None:
    first, second = (accounts.login(lab, "ada", PASSWORD, "1.2.3.4") for _ in range(2))
    assert isinstance(first, SignedIn)
    assert isinstance(second, SignedIn)
    with lab.database.writing() as db:
        accounts.logout(db, first.key)
    assert signed_in(lab, first.key) is None
    assert signed_in(lab, second.key) == "ada"
    clock.now += accounts.SESSION
    assert signed_in(lab, second.key) is None
    assert signed_in(lab, "") is None


def test_expired_sessions_and_old_attempts_do_not_pile_up(lab: Lab, clock: FakeClock) -> None:
    accounts.login(lab, "ada", PASSWORD, "1.2.3.4")
    fail(lab, 3)
    clock.now += timedelta(days=31)
    accounts.login(lab, "ada", PASSWORD, "1.2.3.4")
    with lab.database.reading() as db:
        assert len(db.read(select(admin_session)).all()) == 1
    assert attempts(lab) == 1


def test_a_hash_of_an_older_strength_is_renewed_at_the_next_sign_in(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    stronger = PasswordHasher(time_cost=2, memory_cost=8, parallelism=1)
    monkeypatch.setattr(accounts, "hasher", lambda: stronger)
    accounts.login(lab, "ada", PASSWORD, "1.2.3.4")
    with lab.database.reading() as db:
        account = admins.by_name(db, "ada")
    assert account is not None
    assert "t=2" in account.password_hash


@pytest.mark.parametrize(
    ("name", "password"), [("", PASSWORD), ("x" * 65, PASSWORD), ("ada", PASSWORD), ("bob", "short")]
)
def test_accounts_that_cannot_be_are_refused(lab: Lab, name: str, password: str) -> None:
    with pytest.raises(BadInputError), lab.database.writing() as db:
        accounts.create_admin(db, name, password)


def with_password(lab: Lab, password: str | None) -> Lab:
    secret = SecretStr(password) if password else None
    settings = lab.settings.model_copy(update={"admin_password": secret})
    worker = another_worker(lab)
    object.__setattr__(worker, "settings", settings)
    return worker


def test_the_first_admin_gets_a_drawn_password_that_is_told_once(lab: Lab) -> None:
    with lab.database.writing() as db:
        drawn = accounts.ensure_admin(db, with_password(lab, None))
    assert drawn is not None
    assert len(drawn) >= 16
    assert isinstance(accounts.login(lab, "admin", drawn, "1.2.3.4"), SignedIn)
    with lab.database.writing() as db:
        assert accounts.ensure_admin(db, with_password(lab, None)) is None


def test_a_password_from_the_settings_wins_and_ends_older_sessions(lab: Lab) -> None:
    with lab.database.writing() as db:
        assert accounts.ensure_admin(db, with_password(lab, "from settings")) is None
    session = accounts.login(lab, "admin", "from settings", "1.2.3.4")
    assert isinstance(session, SignedIn)
    with lab.database.writing() as db:
        accounts.ensure_admin(db, with_password(lab, "from settings"))
    assert signed_in(lab, session.key) == "admin"
    with lab.database.writing() as db:
        accounts.ensure_admin(db, with_password(lab, "another one"))
    assert signed_in(lab, session.key) is None
    assert isinstance(accounts.login(lab, "admin", "another one", "1.2.3.4"), SignedIn)


def test_the_hash_in_use_is_argon2id_as_recommended(tmp_path: Path) -> None:
    accounts.hasher.cache_clear()
    assert accounts.new_hash("long enough").startswith("$argon2id$v=19$m=65536,t=3,p=4$")
