"""A study's data as tidy CSV: to a folder, or as a zip that is streamed while it is made.

Memory does not grow with the study: people are read a page at a time, and a table leaves in pieces. One
reading transaction spans all tables, so that they belong together. A folder gets its tables side by side; a
zip holds one file after the other, so that its people are read once for each. The manifest is written last:
an export without one was interrupted. What the columns mean stands in `server.services.codebook`.
"""

import io
import json
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic_core import from_json  # reads the same values as json, in half the time

from server.domain import canonical
from server.domain.errors import BadInputError, NotFoundError
from server.domain.plan import has_left
from server.domain.study import from_json as definition_of
from server.services import codebook, tidy, tracks
from server.services.lab import Lab
from server.services.sheets import Sheet
from server.storage import exports
from server.storage.database import DbSession

Mode = Literal["live", "test", "preview", "robot"]
MODES: tuple[Mode, ...] = get_args(Mode)
PEOPLE_A_PAGE = 16
MANIFEST = "manifest.json"


@dataclass(frozen=True, slots=True)
class Choice:
    """What is exported: one study, some modes, practice or not."""

    study_id: int
    slug: str
    modes: tuple[Mode, ...]
    practice: bool

    @property
    def phases(self) -> tuple[str, ...]:
        return ("practice", "main") if self.practice else ("main",)


class _Page:
    """Some people with their trials; `left` holds those who were not heard of for longer than the lease."""

    def __init__(
        self, people: Sequence[tidy.Row], left: frozenset[str], stories: Iterator[tidy.Story]
    ) -> None:
        self.people = {person["id"]: person for person in people}
        self.left = left
        self._stories = stories

    @cached_property
    def stories(self) -> tuple[tidy.Story, ...]:
        """The trials, read when a table asks for them."""
        return tuple(self._stories)


def export(
    lab: Lab, slug: str, modes: Sequence[str], out_dir: Path, *, practice: bool = False
) -> dict[str, Any]:
    """Write tables, codebook and manifest into `out_dir`, which is made if needed; give the manifest.

    Raises:
        NotFoundError: there is no such study.
        BadInputError: an unknown mode, or `out_dir` is not an empty folder or cannot be written to.
    """
    with lab.database.reading() as db, _writable(out_dir), ExitStack() as stack:
        choice = choose(db, slug, modes, practice=practice)
        _prepare(out_dir)
        source = _Source(db, lab, choice)
        sheets = [Sheet(table) for table in (*_BUILDERS, "codebook")]
        files = [stack.enter_context((out_dir / sheet.name).open("wb")) for sheet in sheets]
        for page in source.pages():
            for sheet, file, build in zip(sheets, files, _BUILDERS.values(), strict=False):
                file.writelines(sheet.pieces(build(slug, page)))
        files[-1].writelines(sheets[-1].pieces(codebook.rows()))
        for sheet, file in zip(sheets, files, strict=True):
            file.writelines(sheet.pieces())
        manifest = source.manifest(sheets)
        (out_dir / MANIFEST).write_bytes(_text(manifest))
    return manifest


def stream_zip(lab: Lab, slug: str, modes: Sequence[str], *, practice: bool = False) -> Iterator[bytes]:
    """Give the same files as the pieces of one zip.

    Raises:
        NotFoundError: there is no such study (at the call, before the first piece).
        BadInputError: an unknown mode (likewise).
    """
    with lab.database.reading() as db:
        choice = choose(db, slug, modes, practice=practice)
    return _zipped(lab, choice)


def choose(db: DbSession, slug: str, modes: Sequence[str], *, practice: bool = False) -> Choice:
    """Check what was asked for; no mode at all means live."""
    study = exports.study_row(db, slug) if slug.isprintable() else None
    if study is None:
        raise NotFoundError(f"no study is called {slug}")
    if unknown := sorted(set(modes) - set(MODES)):
        raise BadInputError(f"unknown mode {unknown[0]}: use {', '.join(MODES)}")
    wanted = tuple(mode for mode in MODES if mode in (modes or ("live",)))
    return Choice(study["id"], study["slug"], wanted, practice)


def _prepare(out_dir: Path) -> None:
    if out_dir.exists() and (not out_dir.is_dir() or any(out_dir.iterdir())):
        raise BadInputError(f"{out_dir} is not an empty folder: name another with --out")
    out_dir.mkdir(parents=True, exist_ok=True)


@contextmanager
def _writable(out_dir: Path) -> Iterator[None]:
    """Say in one line why files cannot be written: no such place, no permission, no space left."""
    try:
        yield
    except OSError as error:
        raise BadInputError(f"cannot write to {out_dir}: {error.strerror}") from error


def _zipped(lab: Lab, choice: Choice) -> Iterator[bytes]:
    sink = _Sink()
    with (
        lab.database.reading() as db,
        zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
    ):
        source = _Source(db, lab, choice)
        sheets = [Sheet(table) for table in (*_BUILDERS, "codebook")]
        for sheet in sheets:
            with archive.open(source.entry(sheet.name), "w", force_zip64=True) as file:
                for piece in source.pieces(sheet):
                    file.write(piece)
                    yield from sink.taken()
        archive.writestr(source.entry(MANIFEST), _text(source.manifest(sheets)))
        yield from sink.taken()
    yield from sink.taken()


def _text(manifest: dict[str, Any]) -> bytes:
    return json.dumps(manifest, indent=2, ensure_ascii=False).encode() + b"\n"


class _Sink(io.RawIOBase):
    """A file that cannot seek and gives away what was written to it."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        self._pieces.append(bytes(data))
        return len(self._pieces[-1])

    def taken(self) -> Iterator[bytes]:
        if self._pieces:
            yield b"".join(self._pieces)
            self._pieces.clear()


class _Source:
    """What one transaction shows of a study, at one moment."""

    def __init__(self, db: DbSession, lab: Lab, choice: Choice) -> None:
        self._db = db
        self._choice = choice
        self._moment = lab.now()
        self._versions = exports.version_rows(db, choice.study_id)
        self._lease_began = {
            row["number"]: canonical.minutes_before(self._moment, definition_of(row["definition"]).lease_min)
            for row in self._versions
        }

    def pages(self) -> Iterator[_Page]:
        """Everybody, a page at a time, by id."""
        db, choice, after = self._db, self._choice, ""
        while people := exports.participant_page(db, choice.study_id, choice.modes, after, PEOPLE_A_PAGE):
            after = people[-1]["id"]
            left = frozenset(person["id"] for person in people if self._left(person))
            yield _Page(people, left, _stories(db, [person["id"] for person in people], choice.phases))

    def _left(self, person: tidy.Row) -> bool:
        began = self._lease_began[person["study_version"]]
        return has_left(person["status"], person["last_seen_utc"], began)

    def pieces(self, sheet: Sheet) -> Iterator[bytes]:
        """Give one table, or the codebook, from its header to its end."""
        build = _BUILDERS.get(Path(sheet.name).stem)
        if build is None:
            yield from sheet.pieces(codebook.rows())
            return
        for page in self.pages():
            yield from sheet.pieces(build(self._choice.slug, page))
        yield from sheet.pieces()

    def entry(self, name: str) -> zipfile.ZipInfo:
        """Describe a file of the zip."""
        entry = zipfile.ZipInfo(f"{self._choice.slug}/{name}", self._moment.timetuple()[:6])
        entry.compress_type = zipfile.ZIP_DEFLATED
        return entry

    def manifest(self, sheets: Sequence[Sheet]) -> dict[str, Any]:
        """Say what the files are, once they have gone out."""
        versions = [{key: row[key] for key in ("number", "sha256", "launched_utc")} for row in self._versions]
        return {
            "study": self._choice.slug,
            "study_versions": versions,
            "modes": list(self._choice.modes),
            "practice": self._choice.practice,
            "exported_utc": canonical.utc_text(self._moment),
            "hatlab": version("hatlab"),
            "files": {sheet.name: sheet.facts for sheet in sheets},
        }


def _stories(db: DbSession, people: Sequence[str], phases: Sequence[str]) -> Iterator[tidy.Story]:
    trials = {trial["id"]: trial for trial in exports.trial_rows(db, people, phases)}
    for trial_id, events in groupby(exports.event_rows(db, people, phases), itemgetter(0)):
        read = [(seq, from_json(body), stored_utc) for _, seq, body, stored_utc in events]
        yield tidy.story(trials[trial_id], read)


def _participants(slug: str, page: _Page) -> Iterator[tidy.Cells]:
    for key, person in page.people.items():
        yield tidy.participant_row(slug, person, left=key in page.left)


def _trials(slug: str, page: _Page) -> Iterator[tidy.Cells]:
    for told, entry in zip(page.stories, tracks.entries(page.stories), strict=True):
        key = told.trial["participant_id"]
        yield tidy.trial_row(slug, page.people[key], told, entry, left=key in page.left)


def _steps(_slug: str, page: _Page) -> Iterator[tidy.Cells]:
    for told in page.stories:
        yield from tidy.step_rows(told)


def _agents(_slug: str, page: _Page) -> Iterator[tidy.Cells]:
    for told, track in zip(page.stories, tracks.tracks(page.stories), strict=True):
        yield from tidy.agent_rows(told, track)


_BUILDERS: dict[str, Callable[[str, _Page], Iterator[tidy.Cells]]] = {
    "participants": _participants,
    "trials": _trials,
    "steps": _steps,
    "agents": _agents,
}
