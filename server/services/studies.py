"""Studies as experimenters make them: templates, drafts, launching, opening and closing.

A draft is whatever was typed, kept even while it is wrong. Launching turns it into a version that stays as it
is. What people do is elsewhere (enrol, play); what a definition is, in domain/study.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from server.domain import canonical
from server.domain.errors import BadInputError, DefinitionError, HatlabError, NotFoundError
from server.domain.study import StudyDefinition, contradictions, from_json, misfits, read
from server.services.lab import Lab
from server.services.study_messages import mistakes_of
from server.storage import studies
from server.storage.database import DbSession
from server.storage.studies import StudyRow, VersionRow

TEMPLATES = Path(__file__).parents[1] / "studies"
TASKS = {"parent_child": "Parent & Lost Child", "traffic_junction": "Traffic Junction"}
NO_DRAFT = ""
FIXED = ("slug", "task", "environment")  # what a study is; a copy may have others
SLUG = re.compile(r"[a-z0-9][a-z0-9-]{0,47}")
SLUG_MAX = 48
RESERVED = frozenset({"new"})  # /admin/studies/new is a page


class DraftChangedError(HatlabError):
    """What was confirmed is not what is stored now: another person or another click was faster."""

    status = 409
    title = "The draft has changed"


@dataclass(frozen=True, slots=True)
class Blank:
    """A template to start from."""

    name: str
    title: str
    summary: str


@dataclass(frozen=True, slots=True)
class Study:
    """A study with what its pages show: the newest launched version and what is being edited."""

    row: StudyRow
    version: VersionRow | None
    definition: StudyDefinition | None
    values: Mapping[str, Any]

    @property
    def has_draft(self) -> bool:
        return self.row.draft != NO_DRAFT

    @property
    def base(self) -> str:
        """Names the text that is being edited; a form sends it back, so that nobody overwrites unseen."""
        return canonical.sha256(self.row.draft or (self.version.definition if self.version else ""))


@dataclass(frozen=True, slots=True)
class Saved:
    """`errors` by field; `stale`: somebody saved meanwhile, and nothing was stored."""

    errors: Mapping[str, str]
    stale: bool = False


@cache
def templates() -> tuple[Blank, ...]:
    return tuple(blank(file.stem) for file in sorted(TEMPLATES.glob("*.toml")))


def blank(name: str) -> Blank:
    study = read(template(name))
    arms = ", ".join(arm.name for arm in study.arms)
    return Blank(name, study.title, f"{TASKS[study.task]}, as in the paper. Arms: {arms}.")


def template(name: str) -> dict[str, Any]:
    """The values of a template.

    Raises:
        NotFoundError: there is none of this name.
    """
    file = TEMPLATES / f"{name}.toml"
    if not SLUG.fullmatch(name) or not file.is_file():
        raise NotFoundError(f"there is no template {name!r}")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def find(db: DbSession, slug: str) -> Study:
    """The study at this address.

    Raises:
        NotFoundError: there is none.
    """
    row = studies.by_slug(db, slug) if slug.isprintable() else None  # PostgreSQL takes no null character
    if row is None:
        raise NotFoundError(f"there is no study {slug!r}")
    return study_of(db, row)


def every(db: DbSession) -> list[Study]:
    return [study_of(db, row) for row in studies.every(db)]


def how_many(db: DbSession) -> int:
    return len(studies.every(db))


def study_of(db: DbSession, row: StudyRow) -> Study:
    version = studies.newest_version(db, row.id)
    text = row.draft or (version.definition if version else "{}")
    return Study(row, version, from_json(version.definition) if version else None, canonical.loads(text))


def versions(db: DbSession, study: Study) -> list[VersionRow]:
    """Oldest first."""
    return studies.versions(db, study.row.id)


def held(db: DbSession, slug: str) -> Study:
    """The study, locked until the transaction ends."""
    return study_of(db, studies.hold(db, find(db, slug).row.id))


def create_from_template(db: DbSession, lab: Lab, name: str, title: str, slug: str = "") -> str:
    """Add a draft made from a template; its slug.

    Raises:
        DefinitionError: `title` or `slug` cannot be used.
    """
    return create(db, lab, template(name), title, slug)


def copy(db: DbSession, lab: Lab, source: str, title: str = "", slug: str = "") -> str:
    """Add a draft with the settings and texts of another study, and none of its data; its slug."""
    origin = find(db, source)
    return create(db, lab, origin.values, title or f"Copy of {origin.row.title}"[:200], slug)


def create(db: DbSession, lab: Lab, values: Mapping[str, Any], title: str, slug: str) -> str:
    db.hold()
    named = title.strip()
    wrong = {}
    if not 0 < len(named) <= 200:
        wrong["title"] = "Write a title of 1 to 200 characters."
    chosen = slug.strip() or free_slug(db, named)
    if message := slug_mistake(db, chosen):
        wrong["slug"] = message
    if wrong:
        raise DefinitionError(wrong)
    draft = canonical.dumps({**values, "title": named, "slug": chosen})
    try:
        studies.add(db, chosen, named, "test", draft, lab.now_utc())
    except studies.SlugTakenError as error:  # PostgreSQL: somebody took it since we looked
        raise DefinitionError({"slug": taken(chosen)}) from error
    return chosen


def slug_mistake(db: DbSession, slug: str) -> str | None:
    if not SLUG.fullmatch(slug):
        return f"Use small letters, digits and hyphens, at most {SLUG_MAX}."
    if slug in RESERVED or studies.by_slug(db, slug):
        return taken(slug)
    return None


def taken(slug: str) -> str:
    return f"{slug} is taken. Choose another one."


def free_slug(db: DbSession, title: str) -> str:
    """A slug made from the title, with a number behind it if it is taken."""
    stem = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[: SLUG_MAX - 5].strip("-") or "study"
    number, slug = 1, stem
    while slug_mistake(db, slug):
        number += 1
        slug = f"{stem}-{number}"
    return slug


def judged(values: Mapping[str, Any], lab: Lab) -> tuple[StudyDefinition | None, dict[str, str]]:
    """The definition in `values` if it can be launched here, and a message for each wrong field."""
    return mistakes_of(values, lambda study: {**misfits(study, lab.offers), **dict(contradictions(study))})


def missing_agents(study: Study, lab: Lab) -> set[str]:
    """Agents that the newest version names and this server has not loaded."""
    if study.definition is None:
        return set()
    named = {arm.bundle for arm in study.definition.arms} | {study.definition.panel_bundle or ""}
    return named - {""} - set(lab.offers)


def save_draft(
    db: DbSession, lab: Lab, slug: str, typed: Mapping[str, Any], base: str | None = None
) -> Saved:
    """Store what was typed, right or wrong; slug, task and world stay what they are.

    `base` is the `Study.base` of what the form was filled with; None overwrites whatever is there.
    """
    study = held(db, slug)
    values = {**typed, **{name: study.values[name] for name in FIXED}}
    definition, errors = judged(values, lab)
    if base is not None and base != study.base:
        return Saved(errors, stale=True)
    draft = definition.canonical if definition else canonical.dumps(values)
    if study.version and draft == study.version.definition:
        draft = NO_DRAFT
    title = str(values.get("title", "")).strip()[:200]
    shown = study.row.title if study.version or not title else title
    studies.set_draft(db, study.row.id, shown, draft)
    return Saved(errors)


def discard_draft(db: DbSession, slug: str, base: str) -> None:
    """Go back to the launched version.

    Raises:
        DraftChangedError: the draft is another one now.
        BadInputError: nothing was launched yet, so that nothing would be left.
    """
    study = held(db, slug)
    if study.version is None:
        raise BadInputError("This study was never launched: there is no version to go back to.")
    if base != study.base:
        raise DraftChangedError("It was changed or launched meanwhile. Open the study again to see it.")
    studies.set_draft(db, study.row.id, study.row.title, NO_DRAFT)


def launch(db: DbSession, lab: Lab, slug: str, base: str) -> VersionRow:
    """Freeze the draft as the next version and open the study; `base` is the draft that was confirmed.

    Raises:
        DraftChangedError: that draft was changed or launched meanwhile.
        DefinitionError: it has errors.
    """
    study = held(db, slug)
    if not study.has_draft or base != study.base:
        raise DraftChangedError("It was changed or launched meanwhile. Open the study again to see it.")
    definition, errors = judged(study.values, lab)
    if definition is None or errors:
        raise DefinitionError(errors)
    return freeze(db, lab, study.row.id, definition)


def freeze(db: DbSession, lab: Lab, study_id: int, definition: StudyDefinition) -> VersionRow:
    version = studies.add_version(db, study_id, definition.canonical, definition.sha256, lab.now_utc())
    studies.set_draft(db, study_id, definition.title, NO_DRAFT)
    studies.set_status(db, study_id, "open")
    return version


def set_status(db: DbSession, slug: str, status: str) -> None:
    """Open, pause or close a launched study.

    Raises:
        BadInputError: it was never launched.
    """
    study = held(db, slug)
    if study.version is None:
        raise BadInputError("This study was never launched. Launch it first.")
    studies.set_status(db, study.row.id, status)


def set_mode(db: DbSession, slug: str, mode: str) -> None:
    """Decide whether who enters from now on is live data or a test. Nobody who has entered changes."""
    study = held(db, slug)
    if mode not in {"live", "test"}:
        raise BadInputError(f"a study is in mode live or test, not {mode!r}")
    studies.set_mode(db, study.row.id, mode)


def ensure_demo_studies(db: DbSession, lab: Lab) -> list[str]:
    """The paper's studies, launched and open in test mode; the slugs of those that were added now.

    They are launched even while their agents are missing: the admin says so, and agents may come later.
    """
    db.hold()
    added = []
    for file in sorted(TEMPLATES.glob("*.toml")):
        definition = read(template(file.stem))
        if studies.by_slug(db, definition.slug):
            continue
        number = studies.add(
            db, definition.slug, definition.title, "test", definition.canonical, lab.now_utc()
        )
        freeze(db, lab, number, definition)
        added.append(definition.slug)
    return added
