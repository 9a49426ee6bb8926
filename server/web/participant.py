"""The pages of a session, under `/p/{key}`.

The server decides the state first and shows the page of that state, whatever was asked for.
"""

from collections.abc import Collection

from fastapi import APIRouter
from starlette.responses import RedirectResponse, Response

from server.domain.errors import NotFoundError
from server.recruitment import mturk
from server.recruitment.recognition import exit_link
from server.services import enrol, pages
from server.services.lab import Lab
from server.services.pages import Page as State
from server.web import messages
from server.web.dependencies import CurrentLab, Fields
from server.web.pages import CompletePage, InstructionsPage, PlayPage
from server.web.rendering import html

router = APIRouter()


@router.get("/p/{key}")
def session_page(lab: CurrentLab, key: str) -> Response:
    """The page of the participant's present state."""
    try:
        with lab.database.reading() as db:
            state = pages.page_of(db, lab, enrol.participant_by_key(db, lab, key))
    except NotFoundError:
        return html(messages.unknown_session(), 404)
    return page_of_state(lab, state, key)


@router.post("/p/{key}/next")
def next_page(lab: CurrentLab, key: str, fields: Fields) -> Response:
    """Go on from the page that the form came from; a second press changes nothing."""
    try:
        with lab.database.writing() as db:
            participant = enrol.participant_by_key(db, lab, key)
            pages.advance(db, lab, participant, fields.get("page", ""))
    except NotFoundError:
        return html(messages.unknown_session(), 404)
    return RedirectResponse(f"/p/{key}", 303)


def page_of_state(lab: Lab, state: State, key: str) -> Response:
    """The state as a page; MTurk's worker site may embed its own workers' pages."""
    extra = lab.settings.mturk_extra_host
    frames = mturk.frame_hosts(extra) if state.marketplace == "mturk" else ()
    if state.kind == "instructions":
        return html(instructions(state, key), frames=frames)
    if state.kind == "play":
        return html(play(state, key), frames=frames)
    hosts = mturk.submit_hosts(extra)
    forms = hosts if state.marketplace == "mturk" else ()
    return html(complete(state, hosts), frames=frames, forms=forms)


def instructions(state: State, key: str) -> InstructionsPage:
    return InstructionsPage(
        title=state.study.title,
        task=state.study.task,
        role=state.role,
        block=state.block,
        blocks=state.blocks,
        rounds=state.rounds,
        practice_rounds=state.practice_rounds,
        limit=state.limit,
        child_sees_parent=state.study.child_sees_parent,
        paragraphs=(),
        page=state.name,
        next_url=f"/p/{key}/next",
    )


def play(state: State, key: str) -> PlayPage:
    addresses = {
        "round_url": f"/p/{key}/round",
        "step_url": f"/p/{key}/step",
        "page_url": f"/p/{key}",
    }
    data = {
        **addresses,
        "task": state.study.task,
        "role": state.role,
        "block": state.block,
        "blocks": state.blocks,
        "rounds": state.rounds,
        "practice_rounds": state.practice_rounds,
        "limit": state.limit,
    }
    return PlayPage(
        title=state.study.title,
        task=state.study.task,
        role=state.role,
        block=state.block,
        blocks=state.blocks,
        rounds=state.rounds,
        limit=state.limit,
        data=data,
        **addresses,
    )


def complete(state: State, submit_hosts: Collection[str]) -> CompletePage:
    code = state.completion_code or ""
    link = exit_link(state.marketplace, code, state.parameters, state.study.completion_url, submit_hosts)
    return CompletePage(
        title=state.study.title,
        code=code,
        marketplace=state.marketplace,
        url=link.url if link else None,
        rounds_stored=state.rounds_stored,
        rounds=state.rounds_total,
        text=state.study.texts.complete,
        fields=link.fields if link else {},
    )
