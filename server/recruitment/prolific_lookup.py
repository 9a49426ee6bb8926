"""Reading from Prolific: a study, a submission, everybody of a study. Nothing here changes anything there."""

from urllib.parse import quote

import httpx

from server.recruitment.prolific_http import Connection, RefusedError
from server.recruitment.prolific_wire import Sitting, SittingPage, Study, StudyList, read

PAGE_SIZE = 100


def study_path(posting_id: str, *more: str) -> str:
    return "/".join(("/studies", quote(posting_id, safe=""), *more, ""))


def submission_path(submission_id: str, *more: str) -> str:
    return "/".join(("/submissions", quote(submission_id, safe=""), *more, ""))


def study(connection: Connection, posting_id: str) -> Study:
    return read(Study, connection.get(study_path(posting_id)))


def draft_named(connection: Connection, title: str, internal_name: str) -> Study | None:
    """The unpublished study of this internal name, which lists need not tell."""
    for listed in read(StudyList, connection.get("/studies/")).results:
        if listed.condition == "UNPUBLISHED" and listed.name == title:
            found = study(connection, listed.id)
            if found.internal_name == internal_name:
                return found
    return None


def sitting(connection: Connection, submission_id: str) -> Sitting:
    return read(Sitting, connection.get(submission_path(submission_id)))


def sittings(connection: Connection, posting_id: str) -> dict[str, Sitting]:
    """All of a study by their ids: every page, oldest first, so that whoever comes meanwhile is on the last.

    Pages may be shorter than asked for. The end is the announced count, or a page with nothing new.
    """
    found: dict[str, Sitting] = {}
    number = 1
    while True:
        page = sitting_page(connection, posting_id, number)
        before = len(found)
        found |= {each.id: each for each in page.results}
        if len(found) == before or (page.meta is not None and len(found) >= page.meta.count):
            return found
        number += 1


def sitting_page(connection: Connection, posting_id: str, number: int) -> SittingPage:
    query: dict[str, str | int] = {
        "study": posting_id,
        "page": number,
        "page_size": PAGE_SIZE,
        "ordering": "started_at",
    }
    try:
        return read(SittingPage, connection.get("/submissions/", query))
    except RefusedError as refused:
        if number == 1 or refused.status != httpx.codes.NOT_FOUND:
            raise
    return SittingPage(results=[])  # the page after the last one is not found
