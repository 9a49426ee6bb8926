"""Prolific, faked: a real HTTP server on this machine with the part of its API that hatlab uses.

`/api/v1/…` is the researcher's side and wants the token. `/fake/…` is the participant's side and the tests':
take a place, hand in, let time pass, plan a fault, read who was paid how often. `/` is all that for a person.
"""

import asyncio
import socket
import threading
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import uvicorn
from fastapi import APIRouter, Body, Depends, FastAPI, Form, Header, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse
from fastapi.staticfiles import StaticFiles

from server.domain.errors import BadInputError
from server.simulate.fake_prolific_hooks import WORKSPACE, Hooks
from server.simulate.fake_prolific_market import Market
from server.simulate.fake_prolific_page import page
from server.simulate.fake_prolific_records import Refusal, Study, Submission, cost, stamp
from server.simulate.fake_prolific_weather import Fault, Weather

HOST = "127.0.0.1"
STATIC = Path(__file__).parents[2] / "static"
COOKIE = "fake_prolific_submission"
PAGE_SIZE = 20
STARTED_S = 10.0
COLUMNS = {"reward": "rewards", "bonus": "bonuses", "screen_out": "screen_outs"}

Json = Annotated[dict[str, Any], Body()]
Next = Callable[[Request], Awaitable[Response]]


@dataclass(slots=True)
class FakeProlific:
    """The marketplace, what disturbs it, and whom it tells."""

    token: str
    market: Market = field(default_factory=Market)
    weather: Weather = field(default_factory=Weather)
    hooks: Hooks = field(default_factory=Hooks)

    def __post_init__(self) -> None:
        self.market.on_change = self.hooks.tell


def create_app(fake: FakeProlific) -> FastAPI:
    app = FastAPI(title="Fake Prolific", openapi_url=None)
    app.include_router(researcher(fake))
    app.include_router(participant(fake))
    app.include_router(person(fake))
    app.mount("/static", StaticFiles(directory=STATIC))
    app.add_exception_handler(Refusal, refusal)

    @app.middleware("http")
    async def disturb(request: Request, call_next: Next) -> Response:
        if not request.url.path.startswith("/api/"):
            return await call_next(request)
        return await disturbed(fake.weather, request, call_next)

    return app


async def refusal(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, Refusal)
    return JSONResponse(error.body, error.status)


async def disturbed(weather: Weather, request: Request, call_next: Next) -> Response:
    await asyncio.sleep(weather.delay_s())
    if weather.is_busy():
        return JSONResponse(Refusal(429, "Too many requests").body, 429, weather.retry_after())
    fault = weather.strike(f"{request.method} {request.url.path}")
    if fault is None:
        return await call_next(request)
    if fault.when == "after":
        await call_next(request)
    return JSONResponse(Refusal(fault.status, "A fault").body, fault.status)


def researcher(fake: FakeProlific) -> APIRouter:
    """The API."""

    def allowed(authorization: Annotated[str, Header()] = "") -> None:
        if authorization != f"Token {fake.token}":
            raise Refusal(401, "Authentication credentials were not provided", "Unauthorized")

    router = APIRouter(prefix="/api/v1", dependencies=[Depends(allowed)])
    add_studies(router, fake.market)
    add_submissions(router, fake.market)
    add_bonuses(router, fake.market)
    add_hooks(router, fake.hooks)
    return router


def add_studies(router: APIRouter, market: Market) -> None:
    @router.get("/studies/")
    def studies() -> dict[str, Any]:
        market.settle()
        return {"results": [short_study(market, each) for each in market.studies.values()]}

    @router.post("/studies/", status_code=201)
    def create(body: Json) -> dict[str, Any]:
        return whole_study(market, market.create_study(body))

    @router.get("/studies/{study_id}/")
    def study(study_id: str) -> dict[str, Any]:
        return whole_study(market, market.study(study_id))

    @router.patch("/studies/{study_id}/")
    def change(study_id: str, body: Json) -> dict[str, Any]:
        return whole_study(market, market.change_study(study_id, body))

    @router.post("/studies/{study_id}/transition/")
    def move(study_id: str, body: Json) -> dict[str, Any]:
        return whole_study(market, market.move_study(study_id, str(body.get("action"))))

    @router.post("/studies/{study_id}/screen-out-submissions/")
    def screen_out(study_id: str, body: Json) -> dict[str, str]:
        market.screen_out(study_id, body)
        return {"message": "Screened out"}


def add_submissions(router: APIRouter, market: Market) -> None:
    @router.get("/submissions/")
    def submissions(study: str, page: int = 1, page_size: int = PAGE_SIZE) -> dict[str, Any]:
        market.study(study)
        return paged(market.of_study(study), page, page_size)

    @router.get("/submissions/{submission_id}/")
    def submission(submission_id: str) -> dict[str, Any]:
        return whole_submission(market, market.submission(submission_id))

    @router.post("/submissions/{submission_id}/transition/")
    def move(submission_id: str, body: Json) -> dict[str, Any]:
        return whole_submission(market, market.move_submission(submission_id, body))

    @router.post("/submissions/{submission_id}/request-return/")
    def request_return(submission_id: str, body: Json) -> dict[str, Any]:
        asked = market.request_return(submission_id, body.get("request_return_reasons"))
        return whole_submission(market, asked)


def add_bonuses(router: APIRouter, market: Market) -> None:
    @router.post("/submissions/bonus-payments/", status_code=201)
    def set_up(body: Json) -> dict[str, Any]:
        bulk = market.set_up_bulk(str(body.get("study_id")), str(body.get("csv_bonuses", "")))
        return {"id": bulk.id, "study": bulk.study_id, **cost(amount for _, amount in bulk.amounts)}

    @router.post("/bulk-bonus-payments/{bulk_id}/pay/", status_code=202)
    def pay(bulk_id: str) -> Response:
        market.pay_bulk(bulk_id)
        return Response(status_code=202)


def add_hooks(router: APIRouter, hooks: Hooks) -> None:
    @router.get("/workspaces/")
    def workspaces() -> dict[str, Any]:
        return {"results": [{"id": WORKSPACE, "title": "Fake workspace"}]}

    @router.get("/hooks/secrets/")
    def secrets() -> dict[str, Any]:
        known = [{"id": "1", "value": hooks.secret, "workspace_id": WORKSPACE}] if hooks.secret else []
        return {"results": known}

    @router.post("/hooks/secrets/", status_code=201)
    def new_secret() -> dict[str, str]:
        return {"id": "1", "value": hooks.new_secret(), "workspace_id": WORKSPACE}

    @router.get("/hooks/subscriptions/")
    def subscriptions() -> dict[str, Any]:
        return {"results": [each.shown() for each in hooks.subscriptions.values() if each.is_enabled]}

    @router.post("/hooks/subscriptions/", status_code=201)
    def subscribe(body: Json, response: Response) -> dict[str, Any]:
        made = hooks.subscribe(str(body.get("target_url")), str(body.get("event_type")))
        response.headers["X-Hook-Secret"] = made.confirmation
        return made.shown()

    @router.post("/hooks/subscriptions/{subscription_id}/")
    def confirm(subscription_id: str, body: Json) -> dict[str, Any]:
        return hooks.confirm(subscription_id, body.get("secret")).shown()


def participant(fake: FakeProlific) -> APIRouter:
    """What participants do, for programs; and what only a test can do."""
    router = APIRouter(prefix="/fake")
    market = fake.market

    @router.post("/studies/{study_id}/take")
    def take(study_id: str, participant_id: str | None = None) -> dict[str, str]:
        taken = market.take(study_id, participant_id)
        return {"participant_id": taken.participant_id, **state(taken), "entry_url": market.entry_url(taken)}

    @router.post("/submissions/{submission_id}/begin")
    def begin(submission_id: str) -> dict[str, str]:
        return state(market.begin(submission_id))

    @router.post("/submissions/{submission_id}/hand_in")
    def hand_in(submission_id: str, code: str = "") -> dict[str, str]:
        return state(market.hand_in(submission_id, code))

    @router.post("/submissions/{submission_id}/give_back")
    def give_back(submission_id: str) -> dict[str, str]:
        return state(market.give_back(submission_id))

    @router.post("/submissions/{submission_id}/time_out")
    def time_out(submission_id: str) -> dict[str, str]:
        return state(market.time_out(submission_id))

    @router.post("/clock")
    def advance(seconds: float) -> dict[str, float]:
        market.advance(seconds)
        return {"now": market.now_s()}

    @router.post("/faults")
    def plan(body: Json) -> dict[str, int]:
        fake.weather.faults.append(Fault(**body))
        return {"planned": len(fake.weather.faults)}

    @router.get("/faults")
    def planned() -> list[dict[str, Any]]:
        return [asdict(each) for each in fake.weather.faults]

    @router.get("/ledger")
    def who_was_paid() -> dict[str, Any]:
        return ledger(market)

    return router


def person(fake: FakeProlific) -> APIRouter:
    """The page, its buttons, and the address that a finished participant comes back to."""
    router = APIRouter(default_response_class=HTMLResponse)
    market = fake.market

    @router.get("/")
    def look() -> str:
        return page(market)

    @router.post("/page/take/{study_id}")
    def take(study_id: str) -> Response:
        return sent_to_the_study(market, market.take(study_id).id)

    @router.get("/page/open/{submission_id}")
    def open_link(submission_id: str) -> Response:
        return sent_to_the_study(market, submission_id)

    @router.post("/page/hand_in/{submission_id}")
    def hand_in(submission_id: str, code: Annotated[str, Form()] = "") -> Response:
        market.hand_in(submission_id, code.strip())
        return back()

    @router.post("/page/time_out/{submission_id}")
    def time_out(submission_id: str) -> Response:
        market.time_out(submission_id)
        return back()

    @router.post("/page/give_back/{submission_id}")
    def give_back(submission_id: str) -> Response:
        market.give_back(submission_id)
        return back()

    @router.get("/submissions/complete")
    def complete(request: Request, cc: str = "") -> str:
        try:
            market.hand_in(request.cookies.get(COOKIE, ""), cc)
        except Refusal as refused:
            return page(market, f"Nothing was handed in: {refused}.")
        return page(market, f"Handed in with the code {cc or 'NOCODE'}.")

    return router


def sent_to_the_study(market: Market, submission_id: str) -> Response:
    """To the entry link; a cookie tells later who came back."""
    response = RedirectResponse(market.entry_url(market.begin(submission_id)), 303)
    response.set_cookie(COOKIE, submission_id, httponly=True, samesite="lax")
    return response


def back() -> Response:
    return RedirectResponse("/", 303)


def state(submission: Submission) -> dict[str, str]:
    return {"submission_id": submission.id, "status": submission.status}


def short_study(market: Market, study: Study) -> dict[str, Any]:
    names = ("name", "internal_name", "total_available_places", "reward")
    some = {name: study.fields.get(name) for name in names}
    return {"id": study.id, "status": study.status, "places_taken": market.taken(study.id), **some}


def whole_study(market: Market, study: Study) -> dict[str, Any]:
    return {**study.fields, **short_study(market, study)}


def short_submission(submission: Submission) -> dict[str, Any]:
    return {
        "id": submission.id,
        "participant_id": submission.participant_id,
        "status": submission.status,
        "started_at": stamp(submission.taken_s),
        "completed_at": stamp(submission.completed_s),
        "has_siblings": False,
        "study_code": submission.code,
        "return_requested": stamp(submission.return_requested_s),
    }


def whole_submission(market: Market, submission: Submission) -> dict[str, Any]:
    return {
        "id": submission.id,
        "participant": submission.participant_id,
        "study_id": submission.study_id,
        "status": submission.status,
        "started_at": stamp(submission.taken_s),
        "completed_at": stamp(submission.completed_s),
        "entered_code": submission.code,
        "bonus_payments": [float(amount) for amount in market.bonuses(submission.id)],
        "return_requested": stamp(submission.return_requested_s),
    }


def paged(submissions: list[Submission], number: int, size: int) -> dict[str, Any]:
    """One page; the page after the last one is not found."""
    first = (number - 1) * size
    if number < 1 or (number > 1 and first >= len(submissions)):
        raise Refusal(404, "Invalid page", "Not found")
    more = first + size < len(submissions)
    href = f"/api/v1/submissions/?page={number + 1}" if more else None
    return {
        "results": [short_submission(each) for each in submissions[first : first + size]],
        "_links": {"next": {"href": href, "title": "Next"}},
        "meta": {"count": len(submissions)},
    }


def ledger(market: Market) -> dict[str, Any]:
    """Every payment, and by submission how often the reward was paid and which bonuses."""
    market.settle()
    people: dict[str, dict[str, Any]] = {
        each.id: {"participant_id": each.participant_id, **{column: [] for column in COLUMNS.values()}}
        for each in market.submissions.values()
    }
    for payment in market.payments:
        people[payment.submission_id][COLUMNS[payment.kind]].append(payment.amount_minor)
    payments = [
        {"submission_id": each.submission_id, "kind": each.kind, "amount_minor": each.amount_minor}
        | ({"bulk_id": each.bulk_id} if each.bulk_id else {})
        for each in market.payments
    ]
    return {"submissions": people, "payments": payments}


def listen(port: int) -> socket.socket:
    """Take the port on this machine's own address.

    Raises:
        BadInputError: it cannot be had.
    """
    try:
        return socket.create_server((HOST, port))
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInputError(f"cannot listen on {HOST}:{port}: {reason}; choose another --port") from error


def server(fake: FakeProlific) -> uvicorn.Server:
    kept_s = 120  # a visitor comes back after minutes: their connection must not close at that very moment
    app = create_app(fake)
    config = uvicorn.Config(app, log_level="warning", access_log=False, timeout_keep_alive=kept_s)
    return uvicorn.Server(config)


def advice(url: str, token: str, webhook: Mapping[str, str]) -> str:
    """What to set so that hatlab recruits here."""
    lines = [
        f"fake Prolific listens on {url}",
        f"  HATLAB_PROLIFIC_API={url}/api/v1",
        f"  HATLAB_PROLIFIC_TOKEN={token}",
        *(f"  HATLAB_PROLIFIC_WEBHOOK_SECRET={secret}  # to {target}" for target, secret in webhook.items()),
        f"  completion address of the study: {url}/submissions/complete?cc={{code}}",
    ]
    return "\n".join(lines)


def serve(fake: FakeProlific, port: int, webhook_url: str | None) -> None:
    """Serve until stopped, and say how to use it.

    Raises:
        BadInputError: the port cannot be had, or the webhook's address cannot be used.
    """
    listener = listen(port)
    webhook = {}
    if webhook_url is not None:
        webhook[webhook_url] = fake.hooks.secret or fake.hooks.new_secret()
        try:
            fake.hooks.subscribe(webhook_url, confirmed=True)
        except Refusal as refused:
            raise BadInputError(f"--webhook-url: {refused}") from refused
    print(advice(f"http://{HOST}:{listener.getsockname()[1]}", fake.token, webhook), flush=True)
    server(fake).run([listener])


@contextmanager
def running(fake: FakeProlific) -> Iterator[str]:
    """Serve from a thread, for tests; gives the address."""
    listener = listen(0)
    made = server(fake)
    thread = threading.Thread(target=made.run, args=([listener],), name="fake-prolific", daemon=True)
    thread.start()
    deadline_s = time.monotonic() + STARTED_S
    while not made.started and time.monotonic() < deadline_s:
        time.sleep(0.005)
    try:
        yield f"http://{HOST}:{listener.getsockname()[1]}"
    finally:
        made.should_exit = True
        thread.join(STARTED_S)
        fake.hooks.stop()
        listener.close()
