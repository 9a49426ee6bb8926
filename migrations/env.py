"""Alembic's entry.

`Database.upgrade` passes its connection; on the command line HATLAB_DATABASE_URL names the database.
"""

from alembic import context
from sqlalchemy import Connection

from server.settings import Settings
from server.storage.database import Database
from server.storage.tables import metadata


def migrate(connection: Connection) -> None:
    context.configure(
        connection=connection, target_metadata=metadata, render_as_batch=True, compare_type=True
    )
    with context.begin_transaction():
        context.run_migrations()


given = context.config.attributes.get("connection")
if given is not None:
    migrate(given)
else:
    with Database(Settings().database_url).engine.begin() as connection:
        migrate(connection)
