"""Prolific's webhook: whether a message is genuine, what it says, and how to subscribe to it.

Prolific delivers at least once and in any order. `event_id` stays the same when a message is delivered again;
`raw["sent"]` tells which of two is newer. A message names no study: `posting_id` is empty, and the id of the
submission (the session id of the entry link) has to lead to it.

Source: docs.prolific.com, API reference, Webhooks.
"""

import base64
import hashlib
import hmac
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, SecretStr

from server.recruitment.prolific_http import Connection
from server.recruitment.prolific_wire import read, submission_state
from server.recruitment.recruiter import Change, RecruiterError, Submission

EVENT = "submission.status.change"
AGE_MAX_S = 300.0  # a recorded message is worthless after this; clocks differ by seconds
MILLISECONDS_FROM = 1e11  # "UNIX timestamp": seconds reach this in the year 5138, milliseconds did in 1973
VALUE = re.compile(r"[!-~]{1,200}")  # printable ASCII; Prolific's ids are hexadecimal
STATUS = re.compile(r"[A-Za-z _-]{1,40}")


class WebhookError(RecruiterError):
    """A message that must not be believed, or cannot be read."""


@dataclass(frozen=True, slots=True)
class Subscription:
    """What was subscribed, and the secret that its messages are signed with."""

    id: str
    secret: SecretStr


def receive(secret: SecretStr, headers: Mapping[str, str], body: bytes, now_s: float) -> Change | None:
    """The change that a genuine message tells of; None: it tells of something else.

    Raises:
        WebhookError: forged, old, or malformed.
    """
    check(secret, headers, body, now_s)
    return parse(headers, body)


def check(secret: SecretStr, headers: Mapping[str, str], body: bytes, now_s: float) -> None:
    """Compare the signature in constant time, then the age.

    Raises:
        WebhookError: forged or old.
    """
    known = lowered(headers)
    stamp = known.get("x-prolific-request-timestamp", "")
    given = known.get("x-prolific-request-signature", "")
    if not hmac.compare_digest(signature(secret, stamp, body).encode(), given.encode()):
        raise WebhookError("the signature is wrong: check HATLAB_PROLIFIC_WEBHOOK_SECRET")
    if abs(now_s - seconds(stamp)) > AGE_MAX_S:
        raise WebhookError("the message is too old or this machine's clock is wrong")


def signature(secret: SecretStr, stamp: str, body: bytes) -> str:
    """base64(HMAC-SHA256(secret, timestamp + body))."""
    key = secret.get_secret_value().encode()
    return base64.b64encode(hmac.digest(key, stamp.encode() + body, hashlib.sha256)).decode()


def parse(headers: Mapping[str, str], body: bytes) -> Change | None:
    """What a message says, believed or not.

    Raises:
        WebhookError: it is not a message of Prolific's.
    """
    message = decoded(body)
    if message.get("event_type") != EVENT:
        return None
    known = lowered(headers)
    submission_id = text(message, "resource_id", VALUE)
    status = text(message, "status", STATUS)
    return Change(
        event_id=text(known, "x-event-id", VALUE),
        posting_id="",
        submission=Submission(
            id=submission_id,
            external_id=text(message, "participant_id", VALUE),
            state=submission_state(submission_id, status),
        ),
        raw={"status": status, "sent": known.get("x-timestamp", "")[:40]},
    )


def decoded(body: bytes) -> Mapping[str, Any]:
    try:
        message = json.loads(body)
    except (ValueError, RecursionError):
        message = None
    if not isinstance(message, dict):
        raise WebhookError("the message is not a JSON object")
    return message


def text(message: Mapping[str, Any], name: str, pattern: re.Pattern[str]) -> str:
    value = message.get(name)
    if not isinstance(value, str) or not pattern.fullmatch(value):
        raise WebhookError(f"the message has no usable {name}")
    return value


def seconds(stamp: str) -> float:
    """Since 1970; milliseconds are recognised, because the documents do not name the unit."""
    try:
        value = float(stamp)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise WebhookError("the message has no time")
    return value / 1000 if value > MILLISECONDS_FROM else value


def lowered(headers: Mapping[str, str]) -> dict[str, str]:
    return {name.lower(): value for name, value in headers.items()}


class HookSecret(BaseModel):
    value: str


class HookSecrets(BaseModel):
    results: list[HookSecret]


class Hook(BaseModel):
    id: str
    event_type: str = ""
    target_url: str = ""


class Hooks(BaseModel):
    results: list[Hook]


class Workspace(BaseModel):
    id: str
    title: str = ""


class Workspaces(BaseModel):
    results: list[Workspace]


def workspaces(connection: Connection) -> Mapping[str, str]:
    """Titles of the account's workspaces by their ids; a subscription belongs to one."""
    return {each.id: each.title for each in read(Workspaces, connection.get("/workspaces/")).results}


def subscribe(connection: Connection, workspace_id: str, target_url: str) -> Subscription:
    """Have changes of submissions sent to the address, which must be public and https; again: the same one.

    The workspace's secret is used where there is one. To make another would silence whoever uses the old.
    """
    secret = hook_secret(connection, workspace_id)
    query = {"workspace_id": workspace_id}
    for hook in read(Hooks, connection.get("/hooks/subscriptions/", query)).results:
        if (hook.event_type, hook.target_url) == (EVENT, target_url):
            return Subscription(hook.id, secret)
    body = {"workspace_id": workspace_id, "event_type": EVENT, "target_url": target_url}
    answer, headers = connection.send("POST", "/hooks/subscriptions/", body=body, repeatable=False)
    made = read(Hook, answer)
    confirmation = {"secret": headers.get("X-Hook-Secret", "")}
    connection.post(f"/hooks/subscriptions/{made.id}/", confirmation, repeatable=True)
    return Subscription(made.id, secret)


def hook_secret(connection: Connection, workspace_id: str) -> SecretStr:
    """The secret that the workspace's messages are signed with; made where there is none."""
    query = {"workspace_id": workspace_id}
    known = read(HookSecrets, connection.get("/hooks/secrets/", query)).results
    made = known[0] if known else read(HookSecret, connection.post("/hooks/secrets/", query))
    return SecretStr(made.value)
