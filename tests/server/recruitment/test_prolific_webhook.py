"""Webhooks: which are believed, what they say, and how one subscribes."""

import base64
import hashlib
import hmac
import json
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import SecretStr

from server.recruitment.prolific_http import Connection
from server.recruitment.prolific_webhook import (
    AGE_MAX_S,
    WebhookError,
    parse,
    receive,
    signature,
    subscribe,
    workspaces,
)
from server.recruitment.recruiter import RecruiterError
from server.simulate.fake_prolific import FakeProlific, running
from server.simulate.fake_prolific_hooks import Hooks

SECRET = SecretStr("s3cret")
NOW_S = 1_700_000_000.0
MESSAGE = {
    "resource_id": "60d9aadeb86739de712faee0",
    "event_type": "submission.status.change",
    "participant_id": "60bf9310e8dec401be6e9615",
    "status": "TIMED-OUT",
}


def body(**changes: Any) -> bytes:
    return json.dumps(MESSAGE | changes).encode()


def headers(content: bytes, stamp: str = "1700000000", secret: SecretStr = SECRET) -> dict[str, str]:
    return {
        "x-event-id": "e1",
        "x-timestamp": "1699999999",
        "x-prolific-request-timestamp": stamp,
        "x-prolific-request-signature": signature(secret, stamp, content),
    }


def test_the_signature_is_the_documented_one() -> None:
    expected = base64.b64encode(hmac.new(b"s3cret", b"1700000000" + body(), hashlib.sha256).digest())
    assert signature(SECRET, "1700000000", body()) == expected.decode()


def test_a_genuine_message_says_who_and_what() -> None:
    change = receive(SECRET, headers(body()), body(), NOW_S)
    assert change is not None
    assert change.event_id == "e1"
    assert change.posting_id == ""
    assert (change.submission.id, change.submission.external_id) == (
        "60d9aadeb86739de712faee0",
        "60bf9310e8dec401be6e9615",
    )
    assert change.submission.state == "timed_out"
    assert change.raw == {"status": "TIMED-OUT", "sent": "1699999999"}


def test_headers_may_be_written_in_capitals() -> None:
    shouted = {name.title(): value for name, value in headers(body()).items()}
    assert receive(SECRET, shouted, body(), NOW_S) is not None


@given(place=st.integers(0, len(body()) - 1), bit=st.integers(0, 7))
def test_a_message_that_was_changed_is_refused(place: int, bit: int) -> None:
    changed = bytearray(body())
    changed[place] ^= 1 << bit
    with pytest.raises(WebhookError, match="signature"):
        receive(SECRET, headers(body()), bytes(changed), NOW_S)


@pytest.mark.parametrize(
    "changes",
    [
        {"x-prolific-request-signature": ""},
        {"x-prolific-request-signature": "Zm9yZ2Vk"},
        {"x-prolific-request-signature": "ü"},
        {"x-prolific-request-timestamp": "1700000001"},
        {"x-prolific-request-timestamp": ""},
    ],
)
def test_a_forged_message_is_refused(changes: dict[str, str]) -> None:
    with pytest.raises(WebhookError, match="signature"):
        receive(SECRET, headers(body()) | changes, body(), NOW_S)


def test_a_message_signed_by_another_secret_is_refused() -> None:
    forged = headers(body(), secret=SecretStr("other"))
    with pytest.raises(WebhookError, match="signature"):
        receive(SECRET, forged, body(), NOW_S)
    with pytest.raises(WebhookError, match="signature"):
        receive(SECRET, {}, body(), NOW_S)


@pytest.mark.parametrize("shift_s", [-AGE_MAX_S - 1, AGE_MAX_S + 1])
def test_an_old_message_is_refused(shift_s: float) -> None:
    with pytest.raises(WebhookError, match="too old"):
        receive(SECRET, headers(body()), body(), NOW_S + shift_s)
    assert receive(SECRET, headers(body()), body(), NOW_S + shift_s * 0.9) is not None


@pytest.mark.parametrize("stamp", ["1700000000", "1700000000.25", "1700000000123"])
def test_the_time_may_be_in_seconds_or_milliseconds(stamp: str) -> None:
    assert receive(SECRET, headers(body(), stamp), body(), NOW_S) is not None


@pytest.mark.parametrize("stamp", ["", "now", "nan", "inf", "-inf"])
def test_a_message_without_a_time_is_refused(stamp: str) -> None:
    with pytest.raises(WebhookError, match="time"):
        receive(SECRET, headers(body(), stamp), body(), NOW_S)


@pytest.mark.parametrize("event", ["study.status.change", "", None, "submission.status.changed"])
def test_another_event_is_nothing(event: str | None) -> None:
    content = body(event_type=event)
    assert receive(SECRET, headers(content), content, NOW_S) is None


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[]",
        b"\xff",
        b"[" * 100_000,
        body(resource_id=None),
        body(resource_id="a\nb"),
        body(participant_id=7),
        body(status=""),
        body(status="HIBERNATING"),
    ],
)
def test_a_malformed_message_is_an_error(content: bytes) -> None:
    with pytest.raises(RecruiterError) as caught:
        receive(SECRET, headers(content), content, NOW_S)
    assert "\n" not in str(caught.value)


def test_a_message_without_an_id_is_an_error() -> None:
    with pytest.raises(WebhookError, match="x-event-id"):
        parse({}, body())


@given(st.binary())
def test_whatever_comes_is_read_or_refused(content: bytes) -> None:
    with suppress(WebhookError):
        assert parse({"x-event-id": "e"}, content) is None


# Subscribing

KEY = "t0k3n"
TARGET = "https://study.example.org/hooks/prolific"


@pytest.fixture
def hooks() -> Hooks:
    return Hooks(1)


@pytest.fixture
def connection(hooks: Hooks) -> Iterator[Connection]:
    with running(FakeProlific(KEY, hooks=hooks)) as url:
        made = Connection(f"{url}/api/v1", SecretStr(KEY), transport=httpx.HTTPTransport())
        yield made
        made.close()


def test_a_subscription_is_confirmed_and_made_once(connection: Connection, hooks: Hooks) -> None:
    (workspace,) = workspaces(connection)
    first = subscribe(connection, workspace, TARGET)
    assert subscribe(connection, workspace, TARGET) == first
    assert [each.is_enabled for each in hooks.subscriptions.values()] == [True]
    assert first.secret.get_secret_value() == hooks.secret
    assert str(hooks.secret) not in repr(first)


def test_a_secret_that_others_use_stays(connection: Connection, hooks: Hooks) -> None:
    known = hooks.new_secret()
    assert subscribe(connection, "fake-workspace", TARGET).secret.get_secret_value() == known


def test_an_address_that_prolific_cannot_reach_safely_is_refused(connection: Connection) -> None:
    with pytest.raises(RecruiterError, match="target_url"):
        subscribe(connection, "fake-workspace", "http://study.example.org/hooks")
