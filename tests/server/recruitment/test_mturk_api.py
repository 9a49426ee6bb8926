"""MTurk as a recruiter: boto3 against the fake, over HTTP. Money moves once, and nothing leaks."""

import builtins
import logging
from collections.abc import Iterator
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import httpx
import pytest
from pydantic import SecretStr

from server.recruitment import mturk_xml as xml
from server.recruitment.mturk_api import MTurkRecruiter
from server.recruitment.mturk_client import MTurkClient
from server.recruitment.mturk_hit import LIVE
from server.recruitment.recruiter import Bonus, Recruiter, RecruiterError
from server.simulate.fake_mturk import ACCESS_KEY_ID, SECRET_ACCESS_KEY
from server.simulate.mturk_market import RequestError, answers
from server.simulate.mturk_operations import OPERATIONS
from tests.server.recruitment.mturk_site import POSTING, Site, mturk_site


@pytest.fixture(scope="module", name="running")
def a_fake_that_answers() -> Iterator[tuple[Site, MTurkClient]]:
    """One for all tests: a boto3 client takes as long to make as ten of them to run."""
    with mturk_site() as site:
        client = site.client()
        yield site, client
        client.close()


@pytest.fixture(name="site")
def an_empty_marketplace(running: tuple[Site, MTurkClient]) -> Site:
    assert httpx.post(f"{running[0].url}/fake/reset").status_code == 200
    return running[0]


@pytest.fixture(name="recruiter")
def a_recruiter(site: Site, running: tuple[Site, MTurkClient]) -> MTurkRecruiter:
    return site.recruiter(running[1])


@pytest.fixture(name="forgetful")
def another_recruiter(site: Site, running: tuple[Site, MTurkClient]) -> MTurkRecruiter:
    """Of the same account, in another process: it remembers nothing."""
    return site.recruiter(running[1])


@pytest.fixture(name="open_posting")
def a_published_posting(recruiter: MTurkRecruiter) -> str:
    return recruiter.publish(recruiter.create(POSTING).id).id


def handed_in(site: Site, recruiter: MTurkRecruiter, posting: str, person: str, code: str = "C0DE") -> str:
    submission = site.worker.take(recruiter, posting, person)
    site.worker.hand_in(submission, code)
    return submission


def bonus(submission: str, person: str, cents: int = 125, request: str = "b-1") -> Bonus:
    return Bonus(submission, person, cents, "for the rounds you won", request)


def test_it_is_a_recruiter(recruiter: MTurkRecruiter) -> None:
    as_protocol: Recruiter = recruiter
    assert as_protocol.marketplace == "mturk"


def test_nobody_is_recruited_before_publishing(site: Site, recruiter: MTurkRecruiter) -> None:
    posted = recruiter.create(POSTING)
    assert (posted.state, posted.places) == ("draft", 12)
    assert site.market.hits == {}
    assert list(recruiter.submissions(posted.id)) == []


def test_creating_and_publishing_twice_makes_one_posting(
    site: Site, recruiter: MTurkRecruiter, forgetful: MTurkRecruiter
) -> None:
    first, second = recruiter.create(POSTING), forgetful.create(POSTING)
    assert first == second
    published = [each.publish(first.id) for each in (recruiter, forgetful, recruiter)]
    assert {each.state for each in published} == {"active"}
    assert len(site.market.hits) == len(site.market.qualifications) == 1


def test_a_hit_that_mturk_does_not_list_yet_is_not_made_twice(
    site: Site, forgetful: MTurkRecruiter, open_posting: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing: dict[str, Any] = {"HITs": [], "NumResults": 0}
    monkeypatch.setitem(OPERATIONS, "ListHITsForQualificationType", lambda *_: nothing)
    with pytest.raises(RecruiterError, match="does not list it yet") as caught:
        forgetful.publish(open_posting)
    assert caught.value.again
    assert len(site.market.hits) == 1


def test_the_hit_says_what_the_posting_says(site: Site, recruiter: MTurkRecruiter, open_posting: str) -> None:
    (hit,) = site.market.hits.values()
    kind = site.market.type_of(hit)
    assert (kind["Title"], kind["Reward"], kind["AssignmentDurationInSeconds"]) == (
        POSTING.title,
        "3.50",
        3600,
    )
    assert kind["Keywords"] == "game, driving"
    assert "keyboard" in kind["Description"]
    assert hit.url == POSTING.entry_url, "the ampersand came through the XML"
    assert hit.frame_px == 0
    assert recruiter.posted(open_posting).url.startswith(site.url)


@pytest.mark.parametrize(
    ("change", "said"),
    [({"currency": "GBP"}, "dollars"), ({"places": 0}, "one place"), ({"reward_minor": -1}, "reward")],
)
def test_what_mturk_could_not_post_is_refused_at_once(
    site: Site, recruiter: MTurkRecruiter, change: dict[str, Any], said: str
) -> None:
    with pytest.raises(RecruiterError, match=said):
        recruiter.create(replace(POSTING, **change))
    assert site.market.qualifications == {}


def test_mturk_itself_needs_https(site: Site) -> None:
    recruiter = MTurkRecruiter(site.client(), LIVE)
    with pytest.raises(RecruiterError, match="https"):
        recruiter.create(replace(POSTING, entry_url="http://lab.example/s/x"))


def test_a_pause_lets_nobody_in_and_whoever_is_in_may_finish(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    inside = site.worker.take(recruiter, open_posting, "AADA")
    assert recruiter.pause(open_posting).state == "paused"
    assert recruiter.pause(open_posting).state == "paused"
    assert not site.worker.sees(open_posting, "ABOB")
    site.worker.hand_in(inside, "C0DE")
    assert recruiter.posted(open_posting).state == "paused"
    assert recruiter.publish(open_posting).state == "active"
    assert site.worker.sees(open_posting, "ABOB")


def test_a_posting_that_ran_out_of_time_is_paused_and_can_go_on(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    site.market.forward(31 * 86_400)
    assert recruiter.posted(open_posting).state == "paused"
    assert recruiter.publish(open_posting).state == "active"


def test_places_grow_and_never_shrink(site: Site, recruiter: MTurkRecruiter, open_posting: str) -> None:
    assert recruiter.set_places(open_posting, 15).places == 15
    assert recruiter.set_places(open_posting, 15).places == 15
    with pytest.raises(RecruiterError, match="cannot take places back: there are 15"):
        recruiter.set_places(open_posting, 14)


def test_places_of_a_draft_can_be_changed(site: Site, recruiter: MTurkRecruiter) -> None:
    posted = recruiter.create(replace(POSTING, places=3))
    assert recruiter.set_places(posted.id, 30).places == 30
    assert recruiter.publish(posted.id).places == 30


def test_a_small_hit_never_grows_to_ten(site: Site, recruiter: MTurkRecruiter) -> None:
    small = recruiter.publish(recruiter.create(replace(POSTING, places=3)).id)
    assert recruiter.set_places(small.id, 9).places == 9
    with pytest.raises(RecruiterError, match="can have 9"):
        recruiter.set_places(small.id, 10)
    assert recruiter.posted(small.id).places == 9


def test_submissions_come_from_every_page_with_their_codes(site: Site, recruiter: MTurkRecruiter) -> None:
    posting = recruiter.publish(recruiter.create(replace(POSTING, places=250)).id).id
    (hit,) = site.market.hits.values()
    for number in range(230):
        taken = site.market.accept(f"A{number}", hit.id)
        site.market.submit(taken.id, {"code": f" C{number} & <more>", "other": "x"})
    found = recruiter.submissions(posting)
    assert len({each.id for each in found}) == 230
    assert {each.code for each in found} == {f"C{number} & <more>" for number in range(230)}
    assert {each.state for each in found} == {"awaiting_review"}
    assert all(each.started_utc.endswith("Z") and each.started_utc <= each.completed_utc for each in found)


def test_who_has_not_handed_in_is_not_told_by_mturk(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    site.worker.take(recruiter, open_posting, "AADA")
    site.worker.give_back(site.worker.take(recruiter, open_posting, "ABOB"))
    assert list(recruiter.submissions(open_posting)) == []


def test_a_full_hit_awaits_review_and_is_then_completed(site: Site, recruiter: MTurkRecruiter) -> None:
    posting = recruiter.publish(recruiter.create(replace(POSTING, places=2)).id).id
    handed = [handed_in(site, recruiter, posting, person) for person in ("AADA", "ABOB")]
    assert recruiter.posted(posting).state == "awaiting_review"
    for each in handed:
        recruiter.approve(each)
    assert recruiter.posted(posting).state == "completed"


def test_approving_twice_pays_once(site: Site, recruiter: MTurkRecruiter, open_posting: str) -> None:
    submission = handed_in(site, recruiter, open_posting, "AADA")
    for _ in range(3):
        recruiter.approve(submission)
    assert site.rewards() == [("AADA", "3.50")]
    assert [each.state for each in recruiter.submissions(open_posting)] == ["approved"]


def test_what_somebody_rejected_by_hand_is_not_silently_left(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    submission = handed_in(site, recruiter, open_posting, "AADA")
    client = site.client()
    client.ask("reject_assignment", AssignmentId=submission, RequesterFeedback="by hand")
    client.close()
    with pytest.raises(RecruiterError, match="rejected by hand") as caught:
        recruiter.approve(submission)
    assert not caught.value.again
    assert [each.state for each in recruiter.submissions(open_posting)] == ["rejected"]


def test_an_assignment_that_mturk_does_not_show_yet_is_to_be_approved_later() -> None:
    with mturk_site(delay_s=3_600) as site:
        recruiter = site.recruiter()
        posting = recruiter.publish(recruiter.create(POSTING).id).id
        submission = handed_in(site, recruiter, posting, "AADA")
        assert list(recruiter.submissions(posting)) == []
        with pytest.raises(RecruiterError, match="try again") as caught:
            recruiter.approve(submission)
        assert caught.value.again
        site.market.forward(3_600)
        recruiter.approve(submission)
        assert site.rewards() == [("AADA", "3.50")]
        recruiter.close()


def test_whoever_a_lab_forgets_is_paid_by_mturk_after_three_days(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    handed_in(site, recruiter, open_posting, "AADA")
    site.market.forward(3 * 86_400 - 60)
    assert site.rewards() == []
    site.market.forward(120)
    assert site.rewards() == [("AADA", "3.50")]


def test_screening_out_pays_the_reward_because_mturk_has_nothing_less(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    submission = handed_in(site, recruiter, open_posting, "AADA")
    recruiter.screen_out(open_posting, [submission])
    recruiter.screen_out(open_posting, [submission])
    assert site.rewards() == [("AADA", "3.50")]


@pytest.mark.parametrize("hours", [0, 23, 25, 24 * 90])
def test_a_bonus_is_paid_once_however_late_it_is_sent_again(
    site: Site, recruiter: MTurkRecruiter, forgetful: MTurkRecruiter, open_posting: str, hours: int
) -> None:
    submission = handed_in(site, recruiter, open_posting, "AADA")
    first = recruiter.pay_bonuses(open_posting, [bonus(submission, "AADA")])
    site.market.forward(hours * 3_600)
    again = forgetful.pay_bonuses(open_posting, [bonus(submission, "AADA")])
    assert [each.request for each in first] == [each.request for each in again] == ["b-1"]
    assert site.bonuses() == [("AADA", "1.25")]
    assert [each.bonus_minor for each in recruiter.submissions(open_posting)] == [125]
    assert site.ledger()["payments"][0]["reason"].startswith("for the rounds you won")


def test_two_payments_of_one_person_are_two(site: Site, recruiter: MTurkRecruiter, open_posting: str) -> None:
    submission = handed_in(site, recruiter, open_posting, "AADA")
    recruiter.pay_bonuses(
        open_posting, [bonus(submission, "AADA"), bonus(submission, "AADA", cents=5, request="b-2")]
    )
    assert site.bonuses() == [("AADA", "1.25"), ("AADA", "0.05")]
    assert [each.bonus_minor for each in recruiter.submissions(open_posting)] == [130]


@pytest.mark.parametrize("changed", [{"cents": 126}, {"person": "ABOB"}])
def test_a_name_that_was_paid_is_not_taken_for_another_bonus(
    site: Site,
    recruiter: MTurkRecruiter,
    forgetful: MTurkRecruiter,
    open_posting: str,
    changed: dict[str, Any],
) -> None:
    submissions = {person: handed_in(site, recruiter, open_posting, person) for person in ("AADA", "ABOB")}
    recruiter.pay_bonuses(open_posting, [bonus(submissions["AADA"], "AADA")])
    person = changed.get("person", "AADA")
    other = bonus(**{"submission": submissions[person], "person": person, **changed})
    fresh = bonus(submissions["ABOB"], "ABOB", request="b-2")
    with pytest.raises(RecruiterError, match="other contents"):
        forgetful.pay_bonuses(open_posting, [fresh, other])
    assert site.bonuses() == [("AADA", "1.25")]


def test_a_payment_whose_answer_was_lost_is_taken_as_made(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    submission = handed_in(site, recruiter, open_posting, "AADA")
    recruiter.pay_bonuses(open_posting, [bonus(submission, "AADA")])
    (payment,) = site.market.ledger
    site.market.ledger[:] = [replace(payment, reason="not listed under its name yet")]
    recruiter.pay_bonuses(open_posting, [bonus(submission, "AADA")])
    assert len(site.bonuses()) == 1


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"cents": 0, "request": "b-2"}, "b-2 is 0"),
        ({"person": "ABOB", "request": "b-2"}, "somebody else's"),
        ({"submission": "3NEVER", "request": "b-2"}, "handed in"),
        ({"cents": 900_000, "request": "b-2"}, r"\$10801\.50, and the account has \$10000\.00"),
    ],
)
def test_nothing_is_paid_where_one_bonus_cannot_be(
    site: Site, recruiter: MTurkRecruiter, open_posting: str, wrong: dict[str, Any], said: str
) -> None:
    submission = handed_in(site, recruiter, open_posting, "AADA")
    bad = bonus(**{"submission": submission, "person": "AADA", **wrong})
    with pytest.raises(RecruiterError, match=said):
        recruiter.pay_bonuses(open_posting, [bonus(submission, "AADA"), bad])
    assert site.bonuses() == []


def test_who_took_part_does_not_find_a_later_posting_of_the_study(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    handed_in(site, recruiter, open_posting, "AADA")
    recruiter.remember(open_posting, "AADA")
    recruiter.remember(open_posting, "AADA")
    later = recruiter.publish(recruiter.create(replace(POSTING, reward_minor=400)).id)
    other = recruiter.publish(recruiter.create(replace(POSTING, slug="parent-child", title="Other")).id)
    assert later.id != open_posting
    assert not site.worker.sees(later.id, "AADA")
    assert site.worker.sees(later.id, "ABOB")
    assert site.worker.sees(other.id, "AADA")


def test_a_message_asks_for_the_place_back(site: Site, recruiter: MTurkRecruiter, open_posting: str) -> None:
    recruiter.approve(handed_in(site, recruiter, open_posting, "AADA"))
    later = recruiter.publish(recruiter.create(replace(POSTING, reward_minor=400)).id).id
    held = site.worker.take(recruiter, later, "AADA")
    recruiter.ask_for_return(held, "You did not finish the first page.")
    assert site.ledger()["messages"] == [
        {"worker": "AADA", "subject": "Please return a HIT", "text": "You did not finish the first page."}
    ]


def test_mturk_passes_no_message_on_to_strangers(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    held = site.worker.take(recruiter, open_posting, "AADA")
    with pytest.raises(RecruiterError, match="did not pass the message on") as caught:
        recruiter.ask_for_return(held, "please")
    assert not caught.value.again


def test_what_is_handed_in_cannot_be_returned(
    site: Site, recruiter: MTurkRecruiter, open_posting: str
) -> None:
    with pytest.raises(RecruiterError, match="no return after that"):
        recruiter.ask_for_return(handed_in(site, recruiter, open_posting, "AADA"), "please")
    with pytest.raises(RecruiterError, match="does not say who"):
        recruiter.ask_for_return("3UNKNOWN", "please")


def test_throttling_is_waited_out(site: Site, recruiter: MTurkRecruiter) -> None:
    httpx.post(f"{site.url}/fake/throttle/2")
    assert recruiter.create(POSTING).state == "draft"


def test_a_marketplace_that_stays_busy_is_to_be_asked_again(site: Site) -> None:
    recruiter = site.recruiter(site.client(attempts=1))
    httpx.post(f"{site.url}/fake/throttle/1000")
    with pytest.raises(RecruiterError, match="busy") as caught:
        recruiter.create(POSTING)
    assert caught.value.again
    recruiter.close()


def test_a_marketplace_out_of_reach_is_to_be_asked_again() -> None:
    with mturk_site() as gone:
        client = gone.client(attempts=1)
    with pytest.raises(RecruiterError, match="cannot be reached") as caught:
        MTurkRecruiter(client, gone.url).create(POSTING)
    assert caught.value.again
    client.close()


def test_an_unknown_posting_is_refused_for_good(recruiter: MTurkRecruiter) -> None:
    for posting_id in ("nonsense", "3KIND:3QUALIFICATION"):
        with pytest.raises(RecruiterError) as caught:
            recruiter.posted(posting_id)
        assert not caught.value.again


@pytest.mark.parametrize("key", ["AKIAWRONGWRONGWRONG1", ACCESS_KEY_ID])
def test_no_key_is_in_an_error_a_repr_or_a_log(
    site: Site, key: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    logging.getLogger("botocore").setLevel(logging.NOTSET)
    client = site.client(key=key)
    recruiter = site.recruiter(client)
    quoted = f"denied: Credential={key}/20260101, secret {SECRET_ACCESS_KEY}"
    monkeypatch.setitem(OPERATIONS, "ListQualificationTypes", quoting(quoted))
    with caplog.at_level(logging.DEBUG), pytest.raises(RecruiterError) as caught:
        recruiter.create(POSTING)
    error = caught.value
    assert (error.__cause__, error.__context__) == (None, None)
    seen = f"{error!r} {error} {vars(error)} {client!r} {recruiter!r} {caplog.text}"
    assert key not in seen
    assert SECRET_ACCESS_KEY not in seen
    assert ("denied" in seen) == (key == ACCESS_KEY_ID), "what MTurk said is quoted, without the keys"
    client.close()


def quoting(text: str) -> Any:
    def refuse(*_: Any) -> Any:
        raise RequestError("AccessDenied", text)

    return refuse


def test_without_boto3_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name.partition(".")[0] in {"boto3", "botocore"}:
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RecruiterError, match=r"pip install .*\[mturk\]"):
        MTurkClient("http://127.0.0.1:9", SecretStr("a"), SecretStr("b"))


@pytest.mark.parametrize("code", ["C1", "a & b", "<b>", "ä…", "]]>", ""])
def test_a_code_comes_back_from_the_answer(code: str) -> None:
    assert xml.code_of(answers({"first": "x", "code": code})) == code


@pytest.mark.parametrize(
    "document",
    [
        "",
        "no xml",
        "<a/>",
        '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>',
        answers({"other": "C1"}),
    ],
)
def test_an_answer_without_a_code_has_none(document: str) -> None:
    assert xml.code_of(document) == ""


def test_the_question_is_xml_whatever_the_address() -> None:
    root = ET.fromstring(xml.external_question("https://x/?a=1&b=<2>", 700))
    assert [each.text for each in root] == ["https://x/?a=1&b=<2>", "700"]
