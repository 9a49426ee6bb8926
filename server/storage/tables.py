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
