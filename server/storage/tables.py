"""The tables. Times are UTC ISO 8601 text with milliseconds and a Z; JSON is canonical text.

Only trials are event-sourced: `event` is the truth, and every column of `trial` after `number` can be
computed from it. Marketplace ids stand in `identity` and nowhere else.
"""

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    Integer,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
)

CONVENTION = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}
metadata = MetaData(naming_convention=CONVENTION)


def text(name: str, *, nullable: bool = False, unique: bool = False) -> Column[str]:
    return Column(name, Text, nullable=nullable, unique=unique)


def participant_key() -> Column[str]:
    return Column("participant_id", Text, ForeignKey("participant.id", ondelete="CASCADE"), primary_key=True)


installation = Table("installation", metadata, Column("key", Text, primary_key=True), text("value"))

study = Table(
    "study",
    metadata,
    Column("id", Integer, primary_key=True),
    text("slug", unique=True),
    text("title"),
    text("status"),
    text("mode"),
    text("draft"),
    text("created_utc"),
)

study_version = Table(
    "study_version",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("study_id", Integer, ForeignKey("study.id"), nullable=False),
    Column("number", Integer, nullable=False),
    text("definition"),
    text("sha256"),
    text("launched_utc"),
    UniqueConstraint("study_id", "number"),
)

participant = Table(
    "participant",
    metadata,
    Column("id", Text, primary_key=True),
    Column("study_id", Integer, ForeignKey("study.id"), nullable=False, index=True),
    Column("study_version_id", Integer, ForeignKey("study_version.id"), nullable=False),
    text("mode"),
    text("key_sha256", unique=True),
    text("marketplace"),
    text("arm"),
    text("role_order"),
    text("token_permutation"),
    text("number_permutation"),
    text("device"),
    text("browser"),
    text("viewport"),
    text("status"),
    text("page"),
    text("consented_utc"),
    text("last_seen_utc"),
    text("finished_utc", nullable=True),
    text("completion_code", nullable=True),
    text("erased_utc", nullable=True),
)

identity = Table(
    "identity",
    metadata,
    participant_key(),
    Column("study_id", Integer, ForeignKey("study.id"), nullable=False),
    text("marketplace"),
    text("external_id"),
    text("external_hash"),
    text("submission_id", nullable=True),
    text("parameters"),
    UniqueConstraint("study_id", "marketplace", "external_hash"),
)

consent = Table(
    "consent",
    metadata,
    participant_key(),
    text("text_sha256"),
    text("version"),
    text("choice"),
    text("consented_utc"),
)

allocation = Table(
    "allocation",
    metadata,
    participant_key(),
    text("counts"),
    text("cell"),
    Column("probability", Float(53), nullable=False),
    Column("seed", BigInteger, nullable=False),
    text("allocated_utc"),
)

trial = Table(
    "trial",
    metadata,
    Column("id", Text, primary_key=True),
    Column("participant_id", Text, ForeignKey("participant.id", ondelete="CASCADE"), nullable=False),
    Column("round", Integer, nullable=False),
    text("phase"),
    Column("block", Integer, nullable=False),
    text("role"),
    Column("number", Integer, nullable=False),
    Column("situation", Integer, nullable=False),
    text("arm"),
    text("bundle", nullable=True),
    text("bundle_sha256", nullable=True),
    Column("seed", BigInteger, nullable=False),
    Column("last_seq", Integer, nullable=False),
    text("digest"),
    text("outcome", nullable=True),
    Column("steps", Integer, nullable=False),
    Column("progress", Integer, nullable=False),
    text("started_utc"),
    text("ended_utc", nullable=True),
    UniqueConstraint("participant_id", "round"),
)

event = Table(
    "event",
    metadata,
    Column("trial_id", Text, ForeignKey("trial.id", ondelete="CASCADE"), primary_key=True),
    Column("seq", Integer, primary_key=True, autoincrement=False),
    text("body"),
    text("digest"),
    text("stored_utc"),
)

answer = Table(
    "answer",
    metadata,
    participant_key(),
    Column("form", Text, primary_key=True),
    Column("attempt", Integer, primary_key=True, autoincrement=False),
    Column("item", Text, primary_key=True),
    text("value"),
    Column("correct", Boolean, nullable=True),
    Column("first_ms", Float(53), nullable=True),
    Column("last_ms", Float(53), nullable=True),
    Column("changes", Integer, nullable=True),
    text("stored_utc"),
)

browser_event = Table(
    "browser_event",
    metadata,
    participant_key(),
    Column("visit", Text, primary_key=True),
    Column("seq", Integer, primary_key=True, autoincrement=False),
    text("page"),
    text("kind"),
    text("value"),
    Column("at_ms", Float(53), nullable=False),
    text("stored_utc"),
)

journey = Table(
    "journey",
    metadata,
    participant_key(),
    Column("seq", Integer, primary_key=True, autoincrement=False),
    text("event"),
    text("state"),
    text("source"),
    text("stored_utc"),
)

refusal = Table(
    "refusal",
    metadata,
    Column("study_id", Integer, ForeignKey("study.id"), primary_key=True),
    Column("external_hash", Text, primary_key=True),
    text("mode"),
    text("status"),
    text("on_date"),
)

erased = Table(
    "erased",
    metadata,
    Column("study_id", Integer, ForeignKey("study.id"), primary_key=True),
    Column("mode", Text, primary_key=True),
    Column("arm", Text, primary_key=True),
    Column("standing", Text, primary_key=True),
    Column("people", Integer, nullable=False),
)

posting = Table(
    "posting",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("study_id", Integer, ForeignKey("study.id"), nullable=False, index=True),
    text("marketplace"),
    text("external_id"),
    text("state"),
    Column("places", Integer, nullable=False),
    text("content"),
    text("created_utc"),
    text("polled_utc", nullable=True),
    UniqueConstraint("marketplace", "external_id"),
)

submission = Table(
    "submission",
    metadata,
    Column("posting_id", Integer, ForeignKey("posting.id"), primary_key=True),
    Column("id", Text, primary_key=True),
    text("external_hash"),
    text("state"),
    text("code"),
    Column("bonus_minor", Integer, nullable=False),
    text("told_by"),
    text("told_utc"),
)

payment = Table(
    "payment",
    metadata,
    Column("request", Text, primary_key=True),
    Column("posting_id", Integer, ForeignKey("posting.id"), nullable=False, index=True),
    text("participant_id"),
    text("submission_id"),
    text("kind"),
    Column("amount_minor", Integer, nullable=False),
    text("currency"),
    text("state"),
    text("reference"),
    text("detail"),
    text("asked_by"),
    text("asked_utc"),
    text("done_utc", nullable=True),
)

webhook_event = Table(
    "webhook_event",
    metadata,
    Column("marketplace", Text, primary_key=True),
    Column("id", Text, primary_key=True),
    text("received_utc"),
)

admin = Table(
    "admin",
    metadata,
    Column("id", Integer, primary_key=True),
    text("username", unique=True),
    text("password_hash"),
)

admin_session = Table(
    "admin_session",
    metadata,
    Column("key_sha256", Text, primary_key=True),
    Column("admin_id", Integer, ForeignKey("admin.id", ondelete="CASCADE"), nullable=False),
    text("csrf"),
    text("created_utc"),
    text("expires_utc"),
)

login_attempt = Table(
    "login_attempt",
    metadata,
    Column("id", Integer, primary_key=True),
    text("source"),
    text("username"),
    Column("succeeded", Boolean, nullable=False),
    Column("at_utc", Text, nullable=False, index=True),
)
