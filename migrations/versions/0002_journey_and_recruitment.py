"""Answers, the way of each participant, refusals, the browser's log, and recruitment."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "webhook_event",
        sa.Column("marketplace", sa.Text(), nullable=False),
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("received_utc", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("marketplace", "id", name=op.f("pk_webhook_event")),
    )
    op.create_table(
        "posting",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("marketplace", sa.Text(), nullable=False),
        sa.Column("external_id", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("places", sa.Integer(), nullable=False),
        sa.Column("content", sa.Text(), nullable=False),
        sa.Column("created_utc", sa.Text(), nullable=False),
        sa.Column("polled_utc", sa.Text(), nullable=True),
        sa.ForeignKeyConstraint(["study_id"], ["study.id"], name=op.f("fk_posting_study_id_study")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_posting")),
        sa.UniqueConstraint("marketplace", "external_id", name=op.f("uq_posting_marketplace_external_id")),
    )
    op.create_index(op.f("ix_posting_study_id"), "posting", ["study_id"], unique=False)
    op.create_table(
        "refusal",
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("external_hash", sa.Text(), nullable=False),
        sa.Column("mode", sa.Text(), nullable=False),
        sa.Column("status", sa.Text(), nullable=False),
        sa.Column("on_date", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["study_id"], ["study.id"], name=op.f("fk_refusal_study_id_study")),
        sa.PrimaryKeyConstraint("study_id", "external_hash", name=op.f("pk_refusal")),
    )
    op.create_table(
        "payment",
        sa.Column("request", sa.Text(), nullable=False),
        sa.Column("posting_id", sa.Integer(), nullable=False),
        sa.Column("participant_id", sa.Text(), nullable=False),
        sa.Column("submission_id", sa.Text(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("amount_minor", sa.Integer(), nullable=False),
        sa.Column("currency", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("reference", sa.Text(), nullable=False),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.Column("asked_by", sa.Text(), nullable=False),
        sa.Column("asked_utc", sa.Text(), nullable=False),
        sa.Column("done_utc", sa.Text(), nullable=True),
        sa.ForeignKeyConstraint(["posting_id"], ["posting.id"], name=op.f("fk_payment_posting_id_posting")),
        sa.PrimaryKeyConstraint("request", name=op.f("pk_payment")),
    )
    op.create_index(op.f("ix_payment_posting_id"), "payment", ["posting_id"], unique=False)
    op.create_table(
        "submission",
        sa.Column("posting_id", sa.Integer(), nullable=False),
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("external_hash", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("code", sa.Text(), nullable=False),
        sa.Column("bonus_minor", sa.Integer(), nullable=False),
        sa.Column("told_by", sa.Text(), nullable=False),
        sa.Column("told_utc", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["posting_id"], ["posting.id"], name=op.f("fk_submission_posting_id_posting")
        ),
        sa.PrimaryKeyConstraint("posting_id", "id", name=op.f("pk_submission")),
    )
    op.create_table(
        "answer",
        sa.Column("participant_id", sa.Text(), nullable=False),
        sa.Column("form", sa.Text(), nullable=False),
        sa.Column("attempt", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("item", sa.Text(), nullable=False),
        sa.Column("value", sa.Text(), nullable=False),
        sa.Column("correct", sa.Boolean(), nullable=True),
        sa.Column("first_ms", sa.Float(precision=53), nullable=True),
        sa.Column("last_ms", sa.Float(precision=53), nullable=True),
        sa.Column("changes", sa.Integer(), nullable=True),
        sa.Column("stored_utc", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["participant_id"],
            ["participant.id"],
            name=op.f("fk_answer_participant_id_participant"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("participant_id", "form", "attempt", "item", name=op.f("pk_answer")),
    )
    op.create_table(
        "browser_event",
        sa.Column("participant_id", sa.Text(), nullable=False),
        sa.Column("visit", sa.Text(), nullable=False),
        sa.Column("seq", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("page", sa.Text(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("value", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.Float(precision=53), nullable=False),
        sa.Column("stored_utc", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["participant_id"],
            ["participant.id"],
            name=op.f("fk_browser_event_participant_id_participant"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("participant_id", "visit", "seq", name=op.f("pk_browser_event")),
    )
    op.create_table(
        "journey",
        sa.Column("participant_id", sa.Text(), nullable=False),
        sa.Column("seq", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("event", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("source", sa.Text(), nullable=False),
        sa.Column("stored_utc", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["participant_id"],
            ["participant.id"],
            name=op.f("fk_journey_participant_id_participant"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("participant_id", "seq", name=op.f("pk_journey")),
    )
    op.add_column("participant", sa.Column("erased_utc", sa.Text(), nullable=True))


def downgrade() -> None:
    op.drop_column("participant", "erased_utc")
    for table in (
        "journey",
        "browser_event",
        "answer",
        "submission",
        "payment",
        "refusal",
        "posting",
        "webhook_event",
    ):
        op.drop_table(table)
