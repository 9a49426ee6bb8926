"""Rows of studies and of their launched versions. A version is written once and never changed."""

from typing import NamedTuple

from sqlalchemy import func, insert, select, update
from sqlalchemy.exc import IntegrityError

from server.storage.database import DbSession
from server.storage.tables import study, study_version


class SlugTakenError(Exception):
    """Another transaction took the slug first."""


class StudyRow(NamedTuple):
    id: int
    slug: str
    title: str
    status: str
    mode: str
    draft: str
    created_utc: str


class VersionRow(NamedTuple):
    id: int
    study_id: int
    number: int
    definition: str
    sha256: str
    launched_utc: str


STUDY = select(study)
VERSION = select(study_version)


def every(db: DbSession) -> list[StudyRow]:
    return [StudyRow._make(row) for row in db.read(STUDY.order_by(study.c.id))]


def by_slug(db: DbSession, slug: str) -> StudyRow | None:
    row = db.read(STUDY.where(study.c.slug == slug)).one_or_none()
    return StudyRow._make(row) if row else None


def by_id(db: DbSession, study_id: int) -> StudyRow:
    return StudyRow._make(db.read(STUDY.where(study.c.id == study_id)).one())


def hold(db: DbSession, study_id: int) -> StudyRow:
    """The study, locked until the transaction ends: who enrols next must see who enrolled now."""
    db.hold()
    return StudyRow._make(db.read(STUDY.where(study.c.id == study_id).with_for_update()).one())


def add(db: DbSession, slug: str, title: str, mode: str, draft: str, created_utc: str) -> int:
    row = {
        "slug": slug,
        "title": title,
        "status": "draft",
        "mode": mode,
        "draft": draft,
        "created_utc": created_utc,
    }
    try:
        return int(db.write(insert(study).returning(study.c.id), row).scalar_one())
    except IntegrityError as error:
        raise SlugTakenError(slug) from error


def set_draft(db: DbSession, study_id: int, title: str, draft: str) -> None:
    db.write(update(study).where(study.c.id == study_id).values(title=title, draft=draft))


def set_status(db: DbSession, study_id: int, status: str) -> None:
    db.write(update(study).where(study.c.id == study_id).values(status=status))


def set_mode(db: DbSession, study_id: int, mode: str) -> None:
    db.write(update(study).where(study.c.id == study_id).values(mode=mode))


def add_version(db: DbSession, study_id: int, definition: str, sha256: str, launched_utc: str) -> VersionRow:
    """The next version of a study; call `hold` first."""
    newest = db.read(
        select(func.coalesce(func.max(study_version.c.number), 0)).where(study_version.c.study_id == study_id)
    ).scalar_one()
    row = {
        "study_id": study_id,
        "number": newest + 1,
        "definition": definition,
        "sha256": sha256,
        "launched_utc": launched_utc,
    }
    return VersionRow._make(db.write(insert(study_version).returning(*study_version.c), row).one())


def versions(db: DbSession, study_id: int) -> list[VersionRow]:
    """Oldest first."""
    statement = VERSION.where(study_version.c.study_id == study_id).order_by(study_version.c.number)
    return [VersionRow._make(row) for row in db.read(statement)]


def newest_version(db: DbSession, study_id: int) -> VersionRow | None:
    statement = VERSION.where(study_version.c.study_id == study_id).order_by(study_version.c.number.desc())
    row = db.read(statement.limit(1)).one_or_none()
    return VersionRow._make(row) if row else None


def version(db: DbSession, version_id: int) -> VersionRow:
    return VersionRow._make(db.read(VERSION.where(study_version.c.id == version_id)).one())
