"""A study's data as tidy CSV: to a folder, or as a zip that is streamed while it is made.

Memory does not grow with the study: people are read a page at a time, and a table leaves in pieces. One
reading transaction spans all tables, so that they belong together. A folder gets its tables side by side; a
zip holds one file after the other, so that its people are read once for each. The manifest is written last:
an export without one was interrupted. What the columns mean stands in `server.services.codebook`.
"""

import io
import json
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from pydantic_core import from_json  # reads the same values as json, in half the time

from server.domain import canonical
from server.domain.errors import BadInputError, NotFoundError
from server.domain.plan import has_left
from server.domain.study import StudyDefinition
from server.domain.study import from_json as definition_of
from server.services import codebook, flow, probe, tidy, tidy_answers, tracks
from server.services.lab import Lab
from server.services.sheets import Sheet
from server.storage import exports
from server.storage.answers import AnswerRow
from server.storage.browser_log import BrowserEventRow
from server.storage.database import DbSession
from server.storage.journeys import JourneyRow

if TYPE_CHECKING:
    from models.policies.bundle import PolicyBundle
    from models.policies.lexicon import Lexicon

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
    """Some people, and what belongs to them, read when a table asks for it.

    `left` holds those who were not heard of for longer than the lease. Of whoever had the data erased nothing
    is read but the person.
    """

    def __init__(
        self,
        db: DbSession,
        people: Sequence[tidy.Row],
        left: frozenset[str],
        phases: Sequence[str],
        definitions: Mapping[int, StudyDefinition],
        bundles: "Mapping[str, PolicyBundle]",
    ) -> None:
        self.people = {person["id"]: person for person in people}
        self.left = left
        self.known = [person["id"] for person in people if person["erased_utc"] is None]
        self._db, self._phases = db, phases
        self._definitions, self._bundles = definitions, bundles

    def definition(self, person: tidy.Row) -> StudyDefinition:
        return self._definitions[person["study_version"]]

    def lexicon(self, person: tidy.Row) -> "Lexicon | None":
        """What the agent's tokens mean with whom this person played; None: that very agent is not loaded."""
        bundle = self._bundles.get(self.definition(person).arm(person["arm"]).bundle)
        if bundle is None or self.played.get(person["id"]) != {bundle.sha256}:
            return None
        return bundle.lexicon

    @cached_property
    def played(self) -> Mapping[str, set[str]]:
        """By person, the agents that they met, by hash."""
        return exports.bundles_played(self._db, self.known)

    @cached_property
    def stories(self) -> tuple[tidy.Story, ...]:
        return tuple(_stories(self._db, self.known, self._phases))

    @cached_property
    def answers(self) -> Mapping[str, Sequence[AnswerRow]]:
        """By person."""
        return tidy_answers.by_person(exports.answer_rows(self._db, self.known))

    def tallies(self) -> Iterator[tuple[tidy.Row, tidy.Tally]]:
        """Everybody, with what is counted of them."""
        won = exports.won(self._db, self.known, tidy.GOOD_OUTCOMES)
        failed = exports.attention_failed(self._db, self.known)
        for key, person in self.people.items():
            erased = person["erased_utc"] is not None
            yield (
                person,
                tidy.Tally(None, None) if erased else tidy.Tally(won.get(key, 0), failed.get(key, 0)),
            )

    def browser_events(self) -> Iterator[BrowserEventRow]:
        return exports.browser_event_rows(self._db, self.known)

    def journeys(self) -> Sequence[JourneyRow]:
        return exports.journey_rows(self._db, self.known)


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
        sheets = [Sheet(table) for table in (*_BUILDERS, *_WHOLE)]
        files = [stack.enter_context((out_dir / sheet.name).open("wb")) for sheet in sheets]
        for page in source.pages():
            for sheet, file, build in zip(sheets, files, _BUILDERS.values(), strict=False):
                file.writelines(sheet.pieces(build(slug, page)))
        for sheet, file in zip(sheets, files, strict=True):
            file.writelines(sheet.pieces(source.rows(sheet.table)))
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
        sheets = [Sheet(table) for table in (*_BUILDERS, *_WHOLE)]
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
        self._bundles = lab.bundles
        self._moment = lab.now()
        self._versions = exports.version_rows(db, choice.study_id)
        self._definitions = {row["number"]: definition_of(row["definition"]) for row in self._versions}
        self._lease_began = {
            number: canonical.minutes_before(self._moment, definition.lease_min)
            for number, definition in self._definitions.items()
        }
        self._flows = flow.flows(db, choice.study_id, self._moment, choice.modes)

    def pages(self) -> Iterator[_Page]:
        """Everybody, a page at a time, by id."""
        db, choice, after = self._db, self._choice, ""
        while people := exports.participant_page(db, choice.study_id, choice.modes, after, PEOPLE_A_PAGE):
            after = people[-1]["id"]
            left = frozenset(person["id"] for person in people if self._left(person))
            yield _Page(db, people, left, choice.phases, self._definitions, self._bundles)

    def _left(self, person: tidy.Row) -> bool:
        began = self._lease_began[person["study_version"]]
        return has_left(person["status"], person["last_seen_utc"], began)

    def pieces(self, sheet: Sheet) -> Iterator[bytes]:
        """Give one table from its header to its end."""
        if build := _BUILDERS.get(sheet.table):
            for page in self.pages():
                yield from sheet.pieces(build(self._choice.slug, page))
        yield from sheet.pieces(self.rows(sheet.table))

    def rows(self, table: str) -> Iterator[tidy.Cells]:
        """Give the rows of a table that is not made person by person; of another none."""
        if table == "flow":
            yield from flow.rows(self._choice.slug, self._flows)
        if table == "codebook":
            yield from codebook.rows()

    def entry(self, name: str) -> zipfile.ZipInfo:
        """Describe a file of the zip."""
        entry = zipfile.ZipInfo(f"{self._choice.slug}/{name}", self._moment.timetuple()[:6])
        entry.compress_type = zipfile.ZIP_DEFLATED
        return entry

    def _agents(self) -> set[str]:
        return {name for definition in self._definitions.values() for name in definition.agents}

    def manifest(self, sheets: Sequence[Sheet]) -> dict[str, Any]:
        """Say what the files are, once they have gone out."""
        versions = [{key: row[key] for key in ("number", "sha256", "launched_utc")} for row in self._versions]
        return {
            "study": self._choice.slug,
            "study_versions": versions,
            "modes": list(self._choice.modes),
            "practice": self._choice.practice,
            "flow": {each.mode: each.whole for each in self._flows},
            "agents_not_loaded": sorted(self._agents() - set(self._bundles)),
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
    for person, counted in page.tallies():
        pay = page.definition(person).pay
        yield tidy.participant_row(slug, person, counted, pay, left=person["id"] in page.left)


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


def _answers(slug: str, page: _Page) -> Iterator[tidy.Cells]:
    for key, given in page.answers.items():
        person = page.people[key]
        yield from tidy_answers.answer_rows(slug, person, page.definition(person), given)


def _probe(_slug: str, page: _Page) -> Iterator[tidy.Cells]:
    for key, given in page.answers.items():
        person = page.people[key]
        places, numbers = (
            tidy_answers.permuted(person, name) for name in ("token_permutation", "number_permutation")
        )
        marks = probe.marks(page.lexicon(person), places, numbers, given)
        yield from tidy_answers.probe_rows(person, page.definition(person), marks)


def _browser_events(_slug: str, page: _Page) -> Iterator[tidy.Cells]:
    return tidy_answers.browser_event_rows(page.browser_events())


def _journey(_slug: str, page: _Page) -> Iterator[tidy.Cells]:
    return tidy_answers.journey_rows(page.journeys())


_BUILDERS: dict[str, Callable[[str, _Page], Iterator[tidy.Cells]]] = {
    "participants": _participants,
    "trials": _trials,
    "steps": _steps,
    "agents": _agents,
    "answers": _answers,
    "probe": _probe,
    "browser_events": _browser_events,
    "journey": _journey,
}
"""Tables that are made person by person."""
_WHOLE = ("flow", "codebook")
"""Tables that are made once for the study."""
