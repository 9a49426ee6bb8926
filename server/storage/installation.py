"""What this installation keeps for itself: single values by name."""

from sqlalchemy import insert, select

from server.storage.database import DbSession
from server.storage.tables import installation


def value(db: DbSession, key: str) -> str | None:
    return db.read(select(installation.c.value).where(installation.c.key == key)).scalar_one_or_none()


def keep(db: DbSession, key: str, text: str) -> None:
    db.write(insert(installation), {"key": key, "value": text})
