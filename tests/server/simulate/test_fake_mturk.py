"""The fake Mechanical Turk behaves like the real one where it hurts: states, tokens, pages, time, frame."""

import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from html import unescape
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest

from server.recruitment.mturk_client import MTurkClient, RefusedError
from server.recruitment.mturk_xml import external_question
from server.recruitment.recruiter import RecruiterError
from server.simulate.mturk_market import Market, WorkerError
from server.simulate.mturk_operations import create_hit_type, create_hit_with_hit_type
from tests.server.recruitment.mturk_site import Site, mturk_site

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
TYPE = {
    "Title": "Drive <b>",
    "Description": "Through a crossing",
    "Reward": "1.00",
    "AssignmentDurationInSeconds": 600,
}


@pytest.fixture(scope="module", name="running")
def one_fake() -> Iterator[tuple[Site, MTurkClient]]:
    with mturk_site() as site:
        client = site.client(attempts=1)
        yield site, client
        client.close()


@pytest.fixture(name="site")
def an_empty_marketplace(running: tuple[Site, MTurkClient]) -> Site:
    assert httpx.post(f"{running[0].url}/fake/reset").status_code == 200
    return running[0]


@pytest.fixture(name="client")
def its_requester(site: Site, running: tuple[Site, MTurkClient]) -> MTurkClient:
    return running[1]


@pytest.fixture(name="hit")
def a_hit(client: MTurkClient) -> str:
    return made(client)


def made(client: MTurkClient, places: int = 2, **more: Any) -> str:
    kind = client.ask("create_hit_type", **TYPE)["HITTypeId"]
    values = {
        "HITTypeId": kind,
        "MaxAssignments": places,
        "LifetimeInSeconds": 3_600,
        "Question": external_question("https://lab.example/s/x?a=1&b=2", 0),
        **more,
    }
    return str(client.ask("create_hit_with_hit_type", **values)["HIT"]["HITId"])


def status(client: MTurkClient, hit: str) -> tuple[str, int, int, int]:
    found = client.ask("get_hit", HITId=hit)["HIT"]
    return (
        found["HITStatus"],
        found["NumberOfAssignmentsAvailable"],
        found["NumberOfAssignmentsPending"],
        found["NumberOfAssignmentsCompleted"],
    )


def test_a_hit_goes_from_assignable_over_unassignable_to_reviewable(
    site: Site, client: MTurkClient, hit: str
) -> None:
    market = site.market
    seen = [status(client, hit)]
    first, second = market.accept("AADA", hit), market.accept("ABOB", hit)
    seen.append(status(client, hit))
    market.submit(first.id, {"code": "x"})
    market.submit(second.id, {"code": "y"})
    seen.append(status(client, hit))
    client.ask("approve_assignment", AssignmentId=first.id)
    seen.append(status(client, hit))
    assert seen == [
        ("Assignable", 2, 0, 0),
        ("Unassignable", 0, 2, 0),
        ("Reviewable", 0, 0, 0),
        ("Reviewable", 0, 0, 1),
    ]


def test_a_place_comes_back_by_return_and_when_time_is_up(site: Site, client: MTurkClient, hit: str) -> None:
    site.market.give_back(site.market.accept("AADA", hit).id)
    late = site.market.accept("ABOB", hit)
    assert status(client, hit) == ("Assignable", 1, 1, 0)
    assert httpx.post(f"{site.url}/fake/forward/601").status_code == 200
    assert status(client, hit) == ("Assignable", 2, 0, 0)
    done = httpx.post(f"{site.url}/mturk/externalSubmit", data={"assignmentId": late.id, "code": "x"})
    assert (done.status_code, "time is up" in done.text) == (403, True)


def test_an_expired_hit_takes_nobody_and_lets_people_finish(
    site: Site, client: MTurkClient, hit: str
) -> None:
    inside = site.market.accept("AADA", hit)
    client.ask("update_expiration_for_hit", HITId=hit, ExpireAt=site.market.now() - timedelta(hours=1))
    assert status(client, hit)[0] == "Unassignable"
    with pytest.raises(WorkerError, match="no longer available"):
        site.market.accept("ABOB", hit)
    site.market.submit(inside.id, {"code": "x"})
    assert status(client, hit)[0] == "Reviewable"


def test_a_worker_takes_a_hit_once(site: Site, hit: str) -> None:
    site.market.submit(site.market.accept("AADA", hit).id, {"code": "x"})
    with pytest.raises(WorkerError, match="already"):
        site.market.accept("AADA", hit)


@pytest.mark.parametrize("fields", [{}, {"code": "x"}])
def test_a_form_needs_an_assignment_and_one_field_more(site: Site, hit: str, fields: dict[str, str]) -> None:
    held = site.market.accept("AADA", hit).id
    address = f"{site.url}/mturk/externalSubmit"
    codes = [httpx.post(address, data={"assignmentId": held, **fields}).status_code for _ in range(2)]
    assert codes == ([200, 403] if fields else [403, 403])
    assert httpx.post(address, data=fields).status_code == 403


def test_only_what_was_submitted_can_be_decided_and_only_once(
    site: Site, client: MTurkClient, hit: str
) -> None:
    held = site.market.accept("AADA", hit).id
    for operation, more in (("approve_assignment", {}), ("reject_assignment", {"RequesterFeedback": "no"})):
        with pytest.raises(RefusedError, match="can be called with a status of") as caught:
            client.ask(operation, AssignmentId=held, **more)
        assert caught.value.code == "AWS.MechanicalTurk.InvalidAssignmentState"
    site.market.submit(held, {"code": "x"})
    client.ask("reject_assignment", AssignmentId=held, RequesterFeedback="no")
    with pytest.raises(RefusedError):
        client.ask("approve_assignment", AssignmentId=held)
    client.ask("approve_assignment", AssignmentId=held, OverrideRejection=True)
    assert site.rewards() == [("AADA", "1.00")]


def test_a_request_token_works_once_a_day(site: Site, client: MTurkClient) -> None:
    first = made(client, UniqueRequestToken="t")
    with pytest.raises(RefusedError, match=first) as caught:
        made(client, UniqueRequestToken="t")
    assert caught.value.code == "AWS.MechanicalTurk.HITAlreadyExists"
    site.market.forward(86_401)
    assert made(client, UniqueRequestToken="t") != first


def test_the_same_expiration_twice_is_a_repeated_request(site: Site, client: MTurkClient, hit: str) -> None:
    at = site.market.now() + timedelta(days=2)
    client.ask("update_expiration_for_hit", HITId=hit, ExpireAt=at)
    with pytest.raises(RefusedError, match="idempotency token"):
        client.ask("update_expiration_for_hit", HITId=hit, ExpireAt=at)


def test_a_bonus_that_could_not_be_afforded_can_be_paid_later(
    site: Site, client: MTurkClient, hit: str
) -> None:
    held = site.market.accept("AADA", hit).id
    site.market.submit(held, {"code": "x"})
    gift = {
        "WorkerId": "AADA",
        "AssignmentId": held,
        "BonusAmount": "9000.00",
        "Reason": "r",
        "UniqueRequestToken": "t",
    }
    with pytest.raises(RefusedError) as caught:
        client.ask("send_bonus", **gift)
    assert caught.value.code == "AWS.MechanicalTurk.InsufficientFunds"
    site.market.balance *= 2
    client.ask("send_bonus", **gift)
    assert site.bonuses() == [("AADA", "9000.00")]


def test_a_small_hit_stays_small(client: MTurkClient, hit: str) -> None:
    with pytest.raises(RefusedError) as caught:
        client.ask("create_additional_assignments_for_hit", HITId=hit, NumberOfAdditionalAssignments=8)
    assert caught.value.code == "AWS.MechanicalTurk.InvalidMaximumAssignmentsIncrease"


def test_pages_cover_a_list_and_a_mark_is_of_one_list(client: MTurkClient) -> None:
    all_hits = {made(client) for _ in range(7)}
    seen, mark, sizes = set(), {}, []
    while True:
        page = client.ask("list_hits", MaxResults=3, **mark)
        seen |= {each["HITId"] for each in page["HITs"]}
        sizes.append(page["NumResults"])
        if "NextToken" not in page:
            break
        mark = {"NextToken": page["NextToken"]}
    assert (seen, sizes) == (all_hits, [3, 3, 1])
    for wrong in (mark["NextToken"], "made up"):
        with pytest.raises(RefusedError, match="NextToken"):
            client.ask("list_qualification_types", MustBeRequestable=False, MaxResults=3, NextToken=wrong)


@pytest.mark.parametrize(("operation", "values"), [
    ("get_hit", {"HITId": "3NONE"}),
    ("get_assignment", {"AssignmentId": "3NONE"}),
    ("get_qualification_type", {"QualificationTypeId": "3NONE"}),
    ("create_hit_with_hit_type", {"HITTypeId": "3NONE", "LifetimeInSeconds": 60}),
])  # fmt: skip
def test_what_is_not_there_is_named_as_mturk_names_it(
    client: MTurkClient, operation: str, values: dict[str, Any]
) -> None:
    with pytest.raises(RefusedError, match="3NONE does not exist") as caught:
        client.ask(operation, **values)
    assert re.fullmatch(
        r"AWS\.MechanicalTurk\.(HIT|Assignment|QualificationType|HITType)DoesNotExist", caught.value.code
    )


@pytest.mark.parametrize("question", ["", "<broken", "<HTMLQuestion/>"])
def test_a_question_that_is_none_is_refused(client: MTurkClient, question: str) -> None:
    with pytest.raises(RefusedError) as caught:
        made(client, Question=question)
    assert caught.value.code == "AWS.MechanicalTurk.XMLParseError"


def test_only_the_fakes_own_key_opens_it(site: Site) -> None:
    stranger = site.client(key="AKIAREALLOOKINGKEY00")
    with pytest.raises(RecruiterError, match="does not accept the access key"):
        stranger.ask("list_hits")
    stranger.close()
    target = {"x-amz-target": "MTurkRequesterServiceV20170117.ListHITs"}
    unsigned = httpx.post(f"{site.url}/", json={}, headers=target)
    assert unsigned.json()["__type"] == "MissingAuthenticationTokenException"


def test_an_operation_that_it_lacks_is_said(client: MTurkClient) -> None:
    with pytest.raises(RecruiterError, match="knows no operation"):
        client.ask("list_worker_blocks")


def test_each_so_many_th_request_can_be_throttled() -> None:
    with mturk_site(throttle_every=3) as site:
        client = site.client(attempts=1)
        outcomes = []
        for _ in range(6):
            try:
                client.ask("get_account_balance")
                outcomes.append("ok")
            except RefusedError as error:
                outcomes.append(error.code)
        client.close()
    assert outcomes == ["ok", "ok", "ThrottlingException"] * 2


def test_the_frame_gets_what_mturk_gives_it(site: Site, hit: str) -> None:
    preview = frame(httpx.get(f"{site.url}/worker/preview/{hit}?worker=AADA").text)
    assert preview == {
        "a": "1",
        "b": "2",
        "assignmentId": "ASSIGNMENT_ID_NOT_AVAILABLE",
        "hitId": hit,
        "turkSubmitTo": site.url,
    }
    held = site.market.accept("AADA", hit).id
    task = frame(httpx.get(f"{site.url}/worker/task/{held}").text)
    assert task == {**preview, "assignmentId": held, "workerId": "AADA"}
    assert httpx.get(f"{site.url}/worker/preview/3NONE").status_code == 403


def frame(page: str) -> dict[str, str]:
    address = re.search(r'<iframe [^>]*src="([^"]+)"', page)
    assert address
    return {name: values[0] for name, values in parse_qs(urlsplit(unescape(address[1])).query).items()}


def test_pages_show_titles_as_text(site: Site, hit: str) -> None:
    page = httpx.get(f"{site.url}/?worker=%22%3E%3Ci%3E").text
    assert "Drive &lt;b&gt;" in page
    assert "<i>" not in page


def test_ids_and_delays_follow_from_the_seed() -> None:
    def story(seed: int) -> list[object]:
        market = Market(seed, delay_s=60, clock=lambda: NOON)
        values = {**TYPE, "LifetimeInSeconds": 60, "Question": external_question("https://x/", 0)}
        kind = create_hit_type(market, TYPE)
        hit = create_hit_with_hit_type(market, {**values, **kind})["HIT"]["HITId"]
        done = market.submit(market.accept("AADA", hit).id, {"code": "x"})
        assert done.shows is not None
        assert NOON < done.shows < NOON + timedelta(seconds=60)
        return [hit, done.id, done.shows]

    assert story(3) == story(3)
    assert not set(story(3)) & set(story(4))
