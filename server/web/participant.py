"""The pages of a session, under `/p/{key}`.

The server decides the state first and shows the page of that state, whatever was asked for.
"""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter
from pydantic import TypeAdapter, ValidationError
from starlette.responses import RedirectResponse, Response

from server.domain.errors import NotFoundError
from server.recruitment import mturk
from server.services import answer, enrol, lease, leave, pages
from server.services.answer import FormError, ItemTiming
from server.services.lab import Lab
from server.services.pages import Page as State
from server.web import ends, messages, session_pages
from server.web.dependencies import CurrentLab, Fields
from server.web.rendering import html

router = APIRouter()
ANSWER, TIMING = "a.", "t."
TIMINGS = TypeAdapter(ItemTiming)
LONGEST_MS = 1e9


@router.get("/p/{key}")
def session_page(lab: CurrentLab, key: str) -> Response:
    """The page of the participant's present state."""
    try:
        state = state_of(lab, key)
    except NotFoundError:
        return html(messages.unknown_session(), 404)
    return page_of_state(lab, state, key)


def state_of(lab: Lab, key: str) -> State:
    """Where the participant is; whoever was away for too long first claims the place again."""
    with lab.database.reading() as db:
        participant = enrol.participant_by_key(db, lab, key)
        if not lease.has_lapsed(db, lab, participant):
            return pages.page_of(db, lab, participant)
    with lab.database.writing() as db:
        lease.keeps(db, lab, participant)
        return pages.page_of(db, lab, enrol.participant_by_key(db, lab, key))


@router.post("/p/{key}/next")
def next_page(lab: CurrentLab, key: str, fields: Fields) -> Response:
    """Go on from the page that the form came from; a second press changes nothing."""
    try:
        with lab.database.writing() as db:
            participant = enrol.participant_by_key(db, lab, key)
            if lease.keeps(db, lab, participant):
                pages.advance(db, lab, participant, fields.get("page", ""))
    except NotFoundError:
        return html(messages.unknown_session(), 404)
    return RedirectResponse(f"/p/{key}", 303)


@router.post("/p/{key}/answers")
def hand_in(lab: CurrentLab, key: str, fields: Fields) -> Response:
    """Store a form; with a message at each answer that cannot be, and nothing lost."""
    given = {name.removeprefix(ANSWER): text for name, text in fields.items() if name.startswith(ANSWER)}
    number = fields.get("attempt", "")
    attempt = int(number) if number.isascii() and number.isdecimal() and len(number) < 6 else 0
    try:
        with lab.database.writing() as db:
            participant = enrol.participant_by_key(db, lab, key)
            if lease.keeps(db, lab, participant):
                answer.hand_in(db, lab, participant, fields.get("form", ""), attempt, given, timings(fields))
    except NotFoundError:
        return html(messages.unknown_session(), 404)
    except FormError as error:
        state = state_of(lab, key)
        if state.form is None:
            return RedirectResponse(f"/p/{key}", 303)
        page = session_pages.form_page(state, key, given, error.fields)
        return html(page, 422, frames=frames_of(lab, state))
    return RedirectResponse(f"/p/{key}", 303)


def timings(fields: Mapping[str, str]) -> dict[str, ItemTiming]:
    """What the browser measured, item by item; what does not look like it is left out."""
    found = {}
    for name, text in fields.items():
        if name.startswith(TIMING) and (timing := timing_of(text)) is not None:
            found[name.removeprefix(TIMING)] = timing
    return found


def timing_of(text: str) -> ItemTiming | None:
    try:
        timing = TIMINGS.validate_json(text)
    except ValidationError:
        return None
    numbers: list[Any] = [timing.first_ms, timing.last_ms, timing.changes]
    return timing if all(n is None or 0 <= n < LONGEST_MS for n in numbers) else None


@router.get("/p/{key}/withdraw")
def ask_to_withdraw(lab: CurrentLab, key: str) -> Response:
    """Ask whether the data may be kept; nothing has happened yet."""
    try:
        state = state_of(lab, key)
    except NotFoundError:
        return html(messages.unknown_session(), 404)
    if state.kind == "end":
        return RedirectResponse(f"/p/{key}", 303)
    return html(session_pages.withdraw_page(state, key), frames=frames_of(lab, state))


@router.post("/p/{key}/withdraw")
def withdraw(lab: CurrentLab, key: str, fields: Fields) -> Response:
    """Stop; without a clear "yes" the data are not kept."""
    try:
        with lab.database.writing() as db:
            participant = enrol.participant_by_key(db, lab, key)
            leave.withdraw(db, lab, participant, keep=fields.get("keep") == "yes")
    except NotFoundError:
        return html(messages.unknown_session(), 404)
    return RedirectResponse(f"/p/{key}", 303)


def page_of_state(lab: Lab, state: State, key: str) -> Response:
    """The state as a page; MTurk's worker site may embed its own workers' pages."""
    frames = frames_of(lab, state)
    if state.kind == "instructions":
        return html(session_pages.instructions_page(state, key), frames=frames)
    if state.kind == "play":
        return html(session_pages.play_page(state, key), frames=frames)
    if state.kind == "form":
        return html(session_pages.form_page(state, key, {}, {}), frames=frames)
    hosts = mturk.submit_hosts(lab.settings.mturk_extra_host)
    forms = hosts if state.marketplace == "mturk" else ()
    return html(ends.end_page(state, hosts), frames=frames, forms=forms)


def frames_of(lab: Lab, state: State) -> tuple[str, ...]:
    return mturk.frame_hosts(lab.settings.mturk_extra_host) if state.marketplace == "mturk" else ()
