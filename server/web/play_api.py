"""The addresses that scripts post to: a round, a step, and what happens to the browser's window.

Each is one transaction and one thread hop; the answer is canonical JSON, so that equal views are equal bytes.
"""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from server.domain import canonical
from server.services import enrol, play, watch
from server.services.play import PageChange
from server.web.dependencies import CurrentLab
from server.web.schemas import BrowserLog, RoundBody, StepBody

router = APIRouter()

# What schemathesis and readers are told; the handlers themselves answer with finished bytes.
ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"description": "The view of the round, or the page to go to", "content": {"application/json": {}}},
    400: {"description": "The body is no text", "content": {"application/problem+json": {}}},
    404: {"description": "No such session or round", "content": {"application/problem+json": {}}},
    409: {"description": "Already answered; `view` is current", "content": {"application/problem+json": {}}},
    413: {"description": "Body too large", "content": {"application/problem+json": {}}},
    422: {"description": "The body does not fit", "content": {"application/problem+json": {}}},
}


@router.post("/p/{key}/round", responses=ANSWERS, response_class=Response)
def open_round(lab: CurrentLab, key: str, body: RoundBody) -> Response:
    """The round in hand, or after a finished one the next."""
    with lab.database.writing() as db:
        participant = enrol.participant_by_key(db, lab, key)
        found = play.open_round(db, lab, participant, body.after)
    return json_answer({"page": f"/p/{key}"} if isinstance(found, PageChange) else found)


@router.post("/p/{key}/step", responses=ANSWERS, response_class=Response)
def step(lab: CurrentLab, key: str, body: StepBody) -> Response:
    """One decision and what follows from it."""
    with lab.database.writing() as db:
        participant = enrol.participant_by_key(db, lab, key)
        timing = body.timing.model_dump()
        answer = play.decide(db, lab, participant, body.round, body.seq, body.action, timing)
    return json_answer(answer)


@router.post("/p/{key}/events", responses=ANSWERS, response_class=Response)
def browser_events(lab: CurrentLab, key: str, body: BrowserLog) -> Response:
    """Focus, visibility, size and full screen of the window: kept, never punished."""
    happened = [(each.seq, each.kind, each.value, each.at_ms) for each in body.events]
    with lab.database.writing() as db:
        stored = watch.keep(db, lab, enrol.participant_by_key(db, lab, key), body.visit, body.page, happened)
    return json_answer({"stored": stored})


def json_answer(value: Mapping[str, Any]) -> Response:
    return Response(
        canonical.dumps(value), headers={"cache-control": "no-store"}, media_type="application/json"
    )
