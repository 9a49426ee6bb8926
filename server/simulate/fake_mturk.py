"""Mechanical Turk on loopback: boto3 talks to it as to the real one, and a browser finds the worker's site.

The requester's side is `POST /` in AWS's JSON 1.1 protocol; `/fake/...` shows and moves what is inside. The
signature of a request is not checked, but the access key must be the fake's own: a real one is not taken here
by mistake. No route pauses while it changes the market, so that one request is done before the next.
"""

import json
from dataclasses import asdict
from typing import Any, Literal

from fastapi import FastAPI, Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response

from server.simulate import mturk_pages as pages
from server.simulate.mturk_market import Market, RequestError, WorkerError
from server.simulate.mturk_operations import OPERATIONS, Values

TARGET = "MTurkRequesterServiceV20170117."
ACCESS_KEY_ID = "FAKEMTURKACCESSKEYID"
SECRET_ACCESS_KEY = "fake-mturk-secret-access-key"  # noqa: S105 it opens nothing but the fake
JSON_1_1 = "application/x-amz-json-1.1"
REGION = "us-east-1"


class Door:
    """Who gets in and how often: the fake's own key, and not while it is throttled."""

    def __init__(self, throttle_every: int = 0) -> None:
        self.throttle_every = throttle_every
        self.throttle_next = 0
        self._asked = 0

    def refusal(self, headers: Any) -> Response | None:
        self._asked += 1
        credential = f"Credential={ACCESS_KEY_ID}/"
        signed = headers.get("authorization", "")
        if not signed:
            return failed("MissingAuthenticationTokenException", "Missing Authentication Token")
        if credential not in signed or f"/{REGION}/mturk-requester/aws4_request" not in signed:
            return failed(
                "UnrecognizedClientException", "The security token included in the request is invalid."
            )
        regular = self.throttle_every and self._asked % self.throttle_every == 0
        if self.throttle_next or regular:
            self.throttle_next = max(0, self.throttle_next - 1)
            return failed("ThrottlingException", "Rate exceeded")
        return None


def fake_mturk(market: Market, throttle_every: int = 0) -> FastAPI:
    """The whole site over a market; each `throttle_every`-th request is throttled (0: none)."""
    app = FastAPI(
        title="fake MTurk",
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        telemetry={"tracing": False, "metrics": False, "logs": False},
    )
    door = Door(throttle_every)
    requester_side(app, market, door)
    worker_side(app, market)
    inside(app, market, door)

    @app.exception_handler(WorkerError)
    async def refuse(_: Request, error: WorkerError) -> Response:
        return HTMLResponse(pages.said("Not possible", str(error)), 403)

    return app


def requester_side(app: FastAPI, market: Market, door: Door) -> None:
    @app.post("/")
    async def api(request: Request) -> Response:
        values = json.loads(await request.body() or b"{}")
        if refused := door.refusal(request.headers):
            return refused
        return answer(market, request.headers.get("x-amz-target", ""), values)


def answer(market: Market, target: str, values: Values) -> Response:
    operation = OPERATIONS.get(target.removeprefix(TARGET))
    if operation is None or not target.startswith(TARGET):
        return failed("UnknownOperationException", f"The fake knows no operation {target}")
    market.settle()
    try:
        return JSONResponse(operation(market, values), media_type=JSON_1_1)
    except RequestError as error:
        stamp = int(market.now().timestamp() * 1000)
        return failed("RequestError", f"{error} ({stamp})", error.code)
    except KeyError as error:
        return failed("ValidationException", f"Value null at {error} failed to satisfy constraint")


def failed(kind: str, message: str, code: str | None = None) -> Response:
    body = {"__type": kind, "Message": message} | ({"TurkErrorCode": code} if code else {})
    return JSONResponse(body, 400, media_type=JSON_1_1)


def worker_side(app: FastAPI, market: Market) -> None:
    @app.get("/")
    async def listing(worker: str = pages.DEFAULT_WORKER) -> Response:
        return HTMLResponse(pages.listing(market, worker))

    @app.get("/worker/preview/{hit_id}")
    async def preview(request: Request, hit_id: str, worker: str = pages.DEFAULT_WORKER) -> Response:
        if hit_id not in market.hits:
            raise WorkerError("There is no such HIT.")
        return HTMLResponse(pages.preview(market, market.hits[hit_id], worker, site_of(request)))

    @app.post("/worker/accept/{hit_id}")
    async def accept(request: Request, hit_id: str) -> Response:
        form = await request.form()
        made = market.accept(str(form.get("worker", pages.DEFAULT_WORKER)), hit_id)
        return RedirectResponse(f"/worker/task/{made.id}", 303)

    @app.get("/worker/task/{assignment_id}")
    async def task(request: Request, assignment_id: str) -> Response:
        return HTMLResponse(pages.task(market, market.held(assignment_id), site_of(request)))

    @app.post("/worker/return/{assignment_id}")
    async def give_back(assignment_id: str) -> Response:
        market.give_back(assignment_id)
        return HTMLResponse(pages.said("Returned", "Somebody else can take the place now."))

    @app.post("/mturk/externalSubmit")
    async def submit(request: Request) -> Response:
        form = {name: str(value) for name, value in (await request.form()).items()}
        market.submit(form.pop("assignmentId", ""), form)
        return HTMLResponse(pages.said("Submitted", "The requester reviews it now."))


def inside(app: FastAPI, market: Market, door: Door) -> None:
    @app.get("/fake/ledger")
    async def ledger() -> dict[str, Any]:
        lines = [
            asdict(each) | {"amount": f"{each.amount:.2f}", "at": each.at.isoformat()}
            for each in market.ledger
        ]
        return {"balance": f"{market.balance:.2f}", "payments": lines, "messages": market.messages}

    @app.post("/fake/reset")
    async def reset() -> dict[str, str]:
        market.clear()
        door.throttle_next = 0
        return {"now": market.now().isoformat()}

    @app.post("/fake/forward/{seconds}")
    async def forward(seconds: float) -> dict[str, str]:
        market.forward(seconds)
        return {"now": market.now().isoformat()}

    @app.post("/fake/throttle/{requests}")
    async def throttle(requests: int) -> dict[Literal["throttle_next"], int]:
        door.throttle_next = requests
        return {"throttle_next": requests}


def announcement(port: int) -> str:
    """Where it is, and what to set so that a hatlab on this machine uses it.

    The worker's site has another name than 127.0.0.1, so that to a browser they are two sites, as with MTurk.
    """
    return "\n".join(
        (
            f"fake MTurk for workers: http://localhost:{port}/",
            f"HATLAB_MTURK_ENDPOINT=http://127.0.0.1:{port}",
            f"HATLAB_MTURK_ACCESS_KEY_ID={ACCESS_KEY_ID}",
            f"HATLAB_MTURK_SECRET_ACCESS_KEY={SECRET_ACCESS_KEY}",
            f"HATLAB_MTURK_EXTRA_HOST=http://localhost:{port}",
        )
    )


def site_of(request: Request) -> str:
    """The address under which the worker's browser knows the fake, as turkSubmitTo."""
    return f"{request.url.scheme}://{request.url.netloc}"
