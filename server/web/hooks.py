"""What marketplaces tell by themselves. A message is believed only with their signature."""

import time

import structlog
from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from starlette.responses import Response

from server.recruitment import prolific_webhook
from server.recruitment.prolific_webhook import WebhookError
from server.recruitment.recruiter import RecruiterError
from server.services import recruit
from server.web.dependencies import CurrentLab
from server.web.errors import problem

router = APIRouter()
log = structlog.get_logger("hatlab.hooks")


@router.post("/hooks/prolific")
async def prolific(request: Request, lab: CurrentLab) -> Response:
    """A submission changed. The answer is 200 also for what was told before, so that it is not sent again."""
    secret = lab.settings.prolific_webhook_secret
    if secret is None:
        return problem(404, "Not found", "No webhook secret is set: changes are asked for instead.")
    body = await request.body()
    try:
        change = prolific_webhook.receive(secret, dict(request.headers), body, time.time())
    except WebhookError as error:
        log.warning("webhook refused", reason=str(error))
        return problem(403, "Not believed", str(error))
    except RecruiterError as error:  # genuine, but of a state that we do not know: asking will say so too
        log.warning("webhook not understood", reason=str(error))
        return problem(422, "Not understood", str(error))
    if change is not None:
        await run_in_threadpool(recruit.take_change, lab, "prolific", change)
    return Response(status_code=200)
