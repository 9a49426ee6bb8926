"""Accounts of experimenters: passwords, signing in with a brake on guessing, sessions.

Attempts are rows, so that all workers count the same. An attempt is stored as failed *before* the password is
looked at, so that many guesses at once cannot slip past the limit, and no transaction is open while the
password is hashed.
"""

import hashlib
import math
import secrets
import threading
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from server.domain.errors import BadInputError
from server.services.lab import Lab
from server.storage import admins
from server.storage.database import DbSession

OWNER = "admin"
PASSWORD_MIN = 8
PASSWORD_MAX = 256  # hashing longer ones is work for an attacker to ask for
USERNAME_MAX = 64
SESSION = timedelta(hours=12)
WINDOW = timedelta(minutes=15)
KEPT = timedelta(days=30)
# Failed attempts in the window: a person mistypes; a source may hold several people; a username may be
# guessed from many sources, where a low limit would let strangers lock its owner out.
PAIR_MAX, SOURCE_MAX, USERNAME_MAX_FAILURES = 5, 20, 50

HASHING = threading.BoundedSemaphore(2)  # a hash takes 64 MiB: guesses at once must not take all memory


@dataclass(frozen=True, slots=True)
class SignedIn:
    """A new session; `key` goes into the cookie and is stored as its hash only."""

    key: str
    lasts_s: int


@dataclass(frozen=True, slots=True)
class WrongPassword:
    """Also for an unknown username: nobody learns which names exist."""


@dataclass(frozen=True, slots=True)
class Wait:
    """Too many attempts: not looked at. After `seconds` the next one is."""

    seconds: int


@dataclass(frozen=True, slots=True)
class AdminSession:
    username: str
    csrf: str


@cache
def hasher() -> PasswordHasher:
    return PasswordHasher()  # argon2id with the parameters of RFC 9106, low memory


@cache
def nobody() -> str:
    """A hash that is verified for unknown usernames, so that they take as long as known ones."""
    return hasher().hash(secrets.token_urlsafe(16))


def ensure_admin(db: DbSession, lab: Lab, username: str = OWNER) -> str | None:
    """See to it that `username` can sign in. Returns a password that was drawn, to be shown once; else None.

    HATLAB_ADMIN_PASSWORD, where it is set, becomes the password, also of an account that exists (the way back
    in for somebody who lost it); its sessions end then.
    """
    account = admins.by_name(db, username)
    wanted = lab.settings.admin_password
    if account is None:
        password = wanted.get_secret_value() if wanted else secrets.token_urlsafe(12)
        create_admin(db, username, password)
        return None if wanted else password
    if wanted and not matches(account.password_hash, wanted.get_secret_value()):
        admins.set_password(db, account.id, new_hash(wanted.get_secret_value()))
        admins.end_sessions_of(db, account.id)
    return None


def create_admin(db: DbSession, username: str, password: str) -> None:
    """Add an account.

    Raises:
        BadInputError: the name is taken or empty, or the password is shorter than 8 characters.
    """
    name = username.strip().lower()
    if not 0 < len(name) <= USERNAME_MAX:
        raise BadInputError(f"a username has 1 to {USERNAME_MAX} characters")
    db.hold()
    if admins.by_name(db, name):
        raise BadInputError(f"there is already an account {name!r}")
    admins.add(db, name, new_hash(password))


def new_hash(password: str) -> str:
    if not PASSWORD_MIN <= len(password) <= PASSWORD_MAX:
        raise BadInputError(f"the admin password must have {PASSWORD_MIN} to {PASSWORD_MAX} characters")
    return hasher().hash(password)


def matches(password_hash: str, password: str) -> bool:
    try:
        with HASHING:
            return hasher().verify(password_hash, password)
    except (VerificationError, InvalidHashError):
        return False


def login(lab: Lab, username: str, password: str, source: str) -> SignedIn | WrongPassword | Wait:
    """Sign in. Opens its own transactions: the password is hashed between them."""
    name = username.strip().lower()[:USERNAME_MAX]
    attempt = admitted(lab, source, name)
    if isinstance(attempt, Wait):
        return attempt
    with lab.database.reading() as db:
        account = admins.by_name(db, name)
    known = account.password_hash if account else nobody()
    right = matches(known, password[:PASSWORD_MAX])
    if account is None or not right:
        return WrongPassword()
    with lab.database.writing() as db:
        if hasher().check_needs_rehash(account.password_hash):
            admins.set_password(db, account.id, hasher().hash(password))
        admins.attempt_succeeded(db, attempt)
        return new_session(db, lab, account.id)


def admitted(lab: Lab, source: str, username: str) -> int | Wait:
    """The id of the stored attempt, or how long to wait.

    Counted again after the commit: whoever commits last sees all, on PostgreSQL too, where transactions
    overlap.
    """
    now = lab.now()
    with lab.database.writing() as db:
        db.hold()
        admins.forget_attempts_before(db, utc(now - KEPT))
        if early := seconds_to_wait(db, source, username, now, spare=1):
            return Wait(early)
        attempt = admins.add_attempt(db, source, username, utc(now))
    with lab.database.reading() as db:
        late = seconds_to_wait(db, source, username, now, spare=0)
    if late:
        with lab.database.writing() as db:
            admins.forget_attempt(db, attempt)
        return Wait(late)
    return attempt


def seconds_to_wait(db: DbSession, source: str, username: str, now: datetime, spare: int) -> int:
    """Seconds until so many failures are old enough that `spare` more are allowed; 0 if they are now."""
    since = utc(now - WINDOW)
    limits = (
        (PAIR_MAX, admins.failures_since(db, since, source=source, username=username)),
        (SOURCE_MAX, admins.failures_since(db, since, source=source)),
        (USERNAME_MAX_FAILURES, admins.failures_since(db, since, username=username)),
    )
    waits = [0]
    for most, times in limits:
        over = len(times) + spare - most
        if over > 0:
            freed = datetime.fromisoformat(times[over - 1]) + WINDOW
            waits.append(max(1, math.ceil((freed - now).total_seconds())))
    return max(waits)


def new_session(db: DbSession, lab: Lab, admin_id: int) -> SignedIn:
    now = lab.now()
    key = secrets.token_urlsafe(32)
    admins.end_expired_sessions(db, utc(now))
    admins.add_session(db, hashed(key), admin_id, secrets.token_urlsafe(32), utc(now), utc(now + SESSION))
    return SignedIn(key, int(SESSION.total_seconds()))


def session(db: DbSession, lab: Lab, key: str) -> AdminSession | None:
    """Who is signed in with this cookie; None once it has expired or was signed out."""
    found = admins.session(db, hashed(key)) if key else None
    if found is None or found.expires_utc <= utc(lab.now()):
        return None
    return AdminSession(found.username, found.csrf)


def logout(db: DbSession, key: str) -> None:
    admins.end_session(db, hashed(key))


def hashed(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()


def utc(moment: datetime) -> str:
    return moment.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
