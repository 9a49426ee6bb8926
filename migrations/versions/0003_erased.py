"""How many people were erased, so that the flow of a study still adds up: numbers, and nobody's."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "erased",
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("mode", sa.Text(), nullable=False),
        sa.Column("arm", sa.Text(), nullable=False),
        sa.Column("standing", sa.Text(), nullable=False),
        sa.Column("people", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["study_id"], ["study.id"], name=op.f("fk_erased_study_id_study")),
        sa.PrimaryKeyConstraint("study_id", "mode", "arm", "standing", name=op.f("pk_erased")),
    )


def downgrade() -> None:
    op.drop_table("erased")
