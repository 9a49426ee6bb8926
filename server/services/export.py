"""A study's data as tidy CSV: to a folder, or as a zip that is streamed while it is made.

Memory does not grow with the study: people are read a page at a time, and a table leaves in pieces. One
reading transaction spans all tables, so that they belong together. The manifest is written last: an export
without one was interrupted. What the columns mean stands in `server.services.codebook`.
"""

import csv
import hashlib
import io
import json
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import groupby, islice
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic_core import from_json  # reads the same values as json, in half the time

from server.domain import canonical
from server.domain.errors import BadInputError, NotFoundError
from server.domain.participation import has_left
from server.domain.study import from_json as definition_of
from server.services import codebook, tidy, tracks
from server.services.lab import Lab
from server.storage import exports
from server.storage.database import DbSession

Mode = Literal["live", "test", "preview", "robot"]
MODES: tuple[Mode, ...] = get_args(Mode)
PEOPLE_A_PAGE = 16
ROWS_A_PIECE = 1_000
UNSAFE = frozenset("=+-@\t\r")
"""A spreadsheet runs a text that begins with one of these."""


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


@dataclass(frozen=True, slots=True)
class _Page:
    """Some people with their trials; `left` holds those who were not heard of for longer than the lease."""

    people: dict[str, tidy.Row]
    left: frozenset[str]
    stories: tuple[tidy.Story, ...]


def export(
    lab: Lab, slug: str, modes: Sequence[str], out_dir: Path, *, practice: bool = False
) -> dict[str, Any]:
    """Write tables, codebook and manifest into `out_dir`, which is made if needed; give the manifest.

    Raises:
        NotFoundError: there is no such study.
        BadInputError: an unknown mode, or `out_dir` is not an empty folder.
    """
    with lab.database.reading() as db:
        choice = choose(db, slug, modes, practice=practice)
        _prepare(out_dir)
        manifest = _Manifest()
        for name, pieces in _files(db, lab, choice, manifest):
            with (out_dir / name).open("wb") as file:
                for piece in pieces:
                    file.write(piece)
    return manifest.content


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
    study = exports.study_row(db, slug)
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


def _zipped(lab: Lab, choice: Choice) -> Iterator[bytes]:
    sink = _Sink()
    moment = lab.now()
    with (
        lab.database.reading() as db,
        zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
    ):
        for name, pieces in _files(db, lab, choice, _Manifest()):
            entry = zipfile.ZipInfo(f"{choice.slug}/{name}", moment.timetuple()[:6])
            entry.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(entry, "w", force_zip64=True) as file:
                for piece in pieces:
                    file.write(piece)
                    yield from sink.taken()
        yield from sink.taken()
    yield from sink.taken()


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


class _Manifest:
    """Counts and hashes the files as they go out."""

    def __init__(self) -> None:
        self.content: dict[str, Any] = {"files": {}}

    def pieces(self, name: str, rows: Iterable[Sequence[Any]]) -> Iterator[bytes]:
        """Give the CSV text of a table, and remember its rows, size and hash."""
        table = Path(name).stem
        digest, count, size = hashlib.sha256(), 0, 0
        for lines, piece in csv_pieces(table, rows):
            digest.update(piece)
            count, size = count + lines, size + len(piece)
            yield piece
        self.content["files"][name] = {"rows": count, "bytes": size, "sha256": digest.hexdigest()}


def csv_pieces(table: str, rows: Iterable[Sequence[Any]]) -> Iterator[tuple[int, bytes]]:
    """Give RFC 4180 text in pieces, each with its number of rows; the first holds the header, and no row."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(codebook.header(table))
    guarded = _guarded(table)
    iterator = iter(rows)
    count = 0
    while True:
        yield count, text.getvalue().encode()
        text.seek(0)
        text.truncate()
        batch = [safe(row, guarded) for row in islice(iterator, ROWS_A_PIECE)]
        count = len(batch)
        if not batch:
            return
        writer.writerows(batch)


def _guarded(table: str) -> tuple[int, ...]:
    columns = codebook.TABLES.get(table, codebook.CODEBOOK)
    return tuple(index for index, column in enumerate(columns) if column.type == "string")


def safe(row: Sequence[Any], guarded: Sequence[int]) -> Sequence[Any]:
    """Put `'` before the texts that a spreadsheet would run.

    >>> safe(["=1+1", -2], [0])
    ["'=1+1", -2]
    """
    for index in guarded:
        if row[index] and row[index][0] in UNSAFE:
            break
    else:
        return row
    return [
        f"'{cell}" if index in guarded and cell and cell[0] in UNSAFE else cell
        for index, cell in enumerate(row)
    ]


def _files(
    db: DbSession, lab: Lab, choice: Choice, manifest: _Manifest
) -> Iterator[tuple[str, Iterator[bytes]]]:
    """Give every file as name and pieces; each must be used up before the next is asked for."""
    moment = lab.now()
    versions = exports.version_rows(db, choice.study_id)
    leases = {row["number"]: definition_of(row["definition"]).lease_min for row in versions}

    def left(person: tidy.Row) -> bool:
        lease_began = canonical.minutes_before(moment, leases[person["study_version"]])
        return has_left(person["status"], person["last_seen_utc"], lease_began)

    for table, build in _BUILDERS.items():
        pages = _pages(db, choice, left, with_events=table != "participants")
        rows = (row for page in pages for row in build(choice.slug, page))
        yield f"{table}.csv", manifest.pieces(f"{table}.csv", rows)
    yield "codebook.csv", manifest.pieces("codebook.csv", codebook.rows())
    manifest.content |= {
        "study": choice.slug,
        "study_versions": [{k: row[k] for k in ("number", "sha256", "launched_utc")} for row in versions],
        "modes": list(choice.modes),
        "practice": choice.practice,
        "exported_utc": canonical.utc_text(moment),
        "hatlab": version("hatlab"),
    }
    yield "manifest.json", iter([json.dumps(manifest.content, indent=2, ensure_ascii=False).encode() + b"\n"])


def _pages(
    db: DbSession, choice: Choice, left: Callable[[tidy.Row], bool], *, with_events: bool
) -> Iterator[_Page]:
    after = ""
    while people := exports.participant_page(db, choice.study_id, choice.modes, after, PEOPLE_A_PAGE):
        after = people[-1]["id"]
        stories = tuple(_stories(db, [p["id"] for p in people], choice.phases)) if with_events else ()
        yield _Page({p["id"]: p for p in people}, frozenset(p["id"] for p in people if left(p)), stories)


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
