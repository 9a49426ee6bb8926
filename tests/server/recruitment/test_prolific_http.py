"""The connection: what is sent again and what never is, how long it waits, and where the key never shows."""

import logging
import traceback
from collections.abc import Callable, Iterator
from email.utils import formatdate
from time import time
from typing import Any

import httpx
import pytest
from pydantic import SecretStr

from server.recruitment.prolific_api import ProlificRecruiter
from server.recruitment.prolific_http import Connection, LostError, RefusedError
from server.recruitment.recruiter import RecruiterError
from server.simulate.fake_prolific import FakeProlific, running

KEY = "k3y-that-nobody-may-see"
API = "https://api.prolific.example/api/v1"
GONE = httpx.ReadTimeout("no answer")
BUSY = httpx.Response(429)


class Script:
    """A transport that answers in order, the last answer for ever, and keeps what was asked."""

    def __init__(self, *answers: httpx.Response | httpx.HTTPError) -> None:
        self.answers = list(answers)
        self.asked: list[httpx.Request] = []
        self.waits_s: list[float] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.asked.append(request)
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, httpx.HTTPError):
            raise answer
        return httpx.Response(answer.status_code, headers=answer.headers, content=answer.content)

    def connection(self, **options: Any) -> Connection:
        transport = httpx.MockTransport(self)
        return Connection(
            API,
            SecretStr(KEY),
            transport=transport,
            sleep=self.waits_s.append,
            jitter=lambda: 1.0,
            **options,
        )


def ok(body: object = "fine") -> httpx.Response:
    return httpx.Response(200, json=body)


def test_the_key_goes_with_every_request() -> None:
    script = Script(BUSY, ok())
    script.connection().get("/studies/")
    assert [each.headers["Authorization"] for each in script.asked] == [f"Token {KEY}"] * 2
    assert str(script.asked[0].url) == f"{API}/studies/"


@pytest.mark.parametrize("trouble", [BUSY, httpx.Response(503), GONE, httpx.ConnectError("refused")])
def test_a_question_is_asked_again(trouble: httpx.Response | httpx.HTTPError) -> None:
    script = Script(trouble, trouble, ok())
    assert script.connection().get("/studies/") == "fine"
    assert len(script.asked) == 3


@pytest.mark.parametrize("trouble", [httpx.Response(500), httpx.Response(502), GONE, httpx.WriteError("x")])
def test_what_may_have_been_done_is_not_sent_again(trouble: httpx.Response | httpx.HTTPError) -> None:
    script = Script(trouble, ok())
    with pytest.raises(LostError) as caught:
        script.connection().post("/bulk-bonus-payments/b1/pay/", {})
    assert len(script.asked) == 1
    assert not caught.value.again
    assert script.waits_s == []


@pytest.mark.parametrize("trouble", [BUSY, httpx.ConnectError("refused"), httpx.ConnectTimeout("slow")])
def test_what_was_surely_not_done_is_sent_again(trouble: httpx.Response | httpx.HTTPError) -> None:
    script = Script(trouble, ok())
    assert script.connection().post("/bulk-bonus-payments/b1/pay/", {}) == "fine"
    assert len(script.asked) == 2


def test_the_pauses_double_and_end() -> None:
    script = Script(BUSY)
    with pytest.raises(RefusedError) as caught:
        script.connection(tries=5).get("/studies/")
    assert script.waits_s == [1, 2, 4, 8]
    assert len(script.asked) == 5
    assert caught.value.again


def test_chance_shortens_a_pause_by_up_to_half() -> None:
    script = Script(BUSY, ok())
    connection = Connection(
        API,
        SecretStr(KEY),
        transport=httpx.MockTransport(script),
        sleep=script.waits_s.append,
        jitter=lambda: 0.0,
    )
    connection.get("/studies/")
    assert script.waits_s == [0.5]


def test_a_pause_is_as_long_as_prolific_asks() -> None:
    soon = formatdate(time() + 30, usegmt=True)
    script = Script(
        httpx.Response(429, headers={"Retry-After": "7"}),
        httpx.Response(429, headers={"Retry-After": soon}),
        httpx.Response(429, headers={"Retry-After": "soon"}),
        ok(),
    )
    script.connection().get("/studies/")
    assert script.waits_s == [7, pytest.approx(30, abs=2), 4]


def test_nobody_waits_for_an_hour() -> None:
    script = Script(httpx.Response(429, headers={"Retry-After": "3600"}))
    with pytest.raises(RefusedError) as caught:
        script.connection().get("/studies/")
    assert script.waits_s == []
    assert caught.value.again


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (httpx.Response(401), "HATLAB_PROLIFIC_TOKEN"),
        (httpx.Response(403, json={"error": {"detail": "no"}}), "HATLAB_PROLIFIC_TOKEN may not do this: no"),
        (httpx.Response(404, json={"error": {"title": "Not found"}}), "Not found"),
        (
            httpx.Response(400, json={"error": {"detail": {"reward": ["Too\nlow", "Odd"]}}}),
            "reward: Too low, Odd",
        ),
        (httpx.Response(400, text="<html>"), "status 400"),
        (httpx.Response(301, headers={"Location": "https://elsewhere.example/"}), "HATLAB_PROLIFIC_API"),
        (httpx.Response(200, text="<html>"), "HATLAB_PROLIFIC_API"),
    ],
)
def test_an_error_says_what_to_do_in_one_line(answer: httpx.Response, said: str) -> None:
    script = Script(answer)
    with pytest.raises(RecruiterError) as caught:
        script.connection().get("/studies/")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(script.asked) == 1


def test_the_key_is_never_sent_in_clear_to_another_machine() -> None:
    for api in ("http://api.prolific.com/api/v1", "ftp://x", "", "https://"):
        with pytest.raises(RecruiterError, match="HATLAB_PROLIFIC_API"):
            Connection(api, SecretStr(KEY))
    Connection("http://127.0.0.1:8010/api/v1", SecretStr(KEY)).close()


@pytest.mark.parametrize("key", ["", "two words", "line\nbreak", "ключ"])
def test_a_key_that_is_none_is_refused_without_repeating_it(key: str) -> None:
    with pytest.raises(RecruiterError, match="HATLAB_PROLIFIC_TOKEN") as caught:
        Connection(API, SecretStr(key))
    assert not key or key not in str(caught.value)


def echo(request: httpx.Request) -> httpx.Response:
    """A server that repeats the key, as a debugging proxy might."""
    return httpx.Response(400, json={"error": {"detail": f"you sent {request.headers['Authorization']}"}})


def lost(request: httpx.Request) -> httpx.Response:
    raise httpx.ReadTimeout(f"sent {request.headers['Authorization']}", request=request)


@pytest.mark.parametrize("answer", [echo, lost])
def test_the_key_is_in_no_error_and_no_traceback(answer: Callable[[httpx.Request], httpx.Response]) -> None:
    connection = Connection(API, SecretStr(KEY), transport=httpx.MockTransport(answer), sleep=lambda _: None)
    for attempt in (lambda: connection.get("/studies/"), lambda: connection.post("/x/", {})):
        with pytest.raises(RecruiterError) as caught:
            attempt()
        error = caught.value
        assert error.__context__ is None
        assert KEY not in "".join(traceback.format_exception(error)) + repr(error) + str(vars(error))


def printed(thing: object, depth: int = 4) -> Iterator[str]:
    """What a debugger would print of a thing and what hangs on it."""
    yield repr(thing)
    if depth and not isinstance(thing, SecretStr):
        for each in vars(thing).values() if hasattr(thing, "__dict__") else ():
            yield from printed(each, depth - 1)


def test_the_key_is_in_no_repr_and_no_log(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG), running(FakeProlific(KEY)) as url:
        recruiter = ProlificRecruiter.open(f"{url}/api/v1", SecretStr(KEY), httpx.HTTPTransport())
        with pytest.raises(RecruiterError):
            recruiter.posted("nothing")
        shown = "\n".join(printed(recruiter))
        recruiter.close()
    assert "HTTP Request" in caplog.text
    assert KEY not in caplog.text
    assert "SecretStr" in shown
    assert KEY not in shown
