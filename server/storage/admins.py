"""Rows of experimenters: accounts, their sessions, and attempts to sign in."""

from typing import NamedTuple

from sqlalchemy import delete, func, insert, select, update

from server.storage.database import DbSession
from server.storage.tables import admin, admin_session, login_attempt


class Account(NamedTuple):
    id: int
    username: str
    password_hash: str


class StoredSession(NamedTuple):
    username: str
    csrf: str
    expires_utc: str


def by_name(db: DbSession, username: str) -> Account | None:
    row = db.read(
        select(admin.c.id, admin.c.username, admin.c.password_hash).where(admin.c.username == username)
    ).one_or_none()
    return Account._make(row) if row else None


def add(db: DbSession, username: str, password_hash: str) -> None:
    db.write(insert(admin), {"username": username, "password_hash": password_hash})


def set_password(db: DbSession, admin_id: int, password_hash: str) -> None:
    db.write(update(admin).where(admin.c.id == admin_id).values(password_hash=password_hash))


def add_session(
    db: DbSession, key_sha256: str, admin_id: int, csrf: str, created_utc: str, expires_utc: str
) -> None:
    db.write(
        insert(admin_session),
        {
            "key_sha256": key_sha256,
            "admin_id": admin_id,
            "csrf": csrf,
            "created_utc": created_utc,
            "expires_utc": expires_utc,
        },
    )


def session(db: DbSession, key_sha256: str) -> StoredSession | None:
    row = db.read(
        select(admin.c.username, admin_session.c.csrf, admin_session.c.expires_utc)
        .join(admin, admin.c.id == admin_session.c.admin_id)
        .where(admin_session.c.key_sha256 == key_sha256)
    ).one_or_none()
    return StoredSession._make(row) if row else None


def end_session(db: DbSession, key_sha256: str) -> None:
    db.write(delete(admin_session).where(admin_session.c.key_sha256 == key_sha256))


def end_sessions_of(db: DbSession, admin_id: int) -> None:
    db.write(delete(admin_session).where(admin_session.c.admin_id == admin_id))


def end_expired_sessions(db: DbSession, now_utc: str) -> None:
    db.write(delete(admin_session).where(admin_session.c.expires_utc <= now_utc))


def add_attempt(db: DbSession, source: str, username: str, at_utc: str) -> int:
    """An attempt counts as failed until `attempt_succeeded`; the id to call that with."""
    statement = insert(login_attempt).returning(login_attempt.c.id)
    row = {"source": source, "username": username, "succeeded": False, "at_utc": at_utc}
    return int(db.write(statement, row).scalar_one())


def attempt_succeeded(db: DbSession, attempt_id: int) -> None:
    db.write(update(login_attempt).where(login_attempt.c.id == attempt_id).values(succeeded=True))


def forget_attempt(db: DbSession, attempt_id: int) -> None:
    db.write(delete(login_attempt).where(login_attempt.c.id == attempt_id))


def forget_attempts_before(db: DbSession, at_utc: str) -> None:
    db.write(delete(login_attempt).where(login_attempt.c.at_utc < at_utc))


def failures_since(
    db: DbSession, at_utc: str, *, source: str | None = None, username: str | None = None
) -> list[str]:
    """Times of the failed attempts after `at_utc`, oldest first, of a source, a username, or both together.

    For both together the attempts before the last success no longer count.
    """
    conditions = [login_attempt.c.at_utc > at_utc]
    if source is not None:
        conditions.append(login_attempt.c.source == source)
    if username is not None:
        conditions.append(login_attempt.c.username == username)
    if source is not None and username is not None:
        last = select(func.max(login_attempt.c.id)).where(*conditions, login_attempt.c.succeeded.is_(True))
        conditions.append(login_attempt.c.id > func.coalesce(last.scalar_subquery(), 0))
    failed = select(login_attempt.c.at_utc).where(*conditions, login_attempt.c.succeeded.is_(False))
    return [at for (at,) in db.read(failed.order_by(login_attempt.c.at_utc))]
