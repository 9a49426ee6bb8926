"""The made-up Prolific: it refuses what the real one refuses, and its books tell of every mistake."""

import re
import threading
from collections import defaultdict
from collections.abc import Iterator, Mapping
from time import time
from typing import Any

import httpx
import pytest
from pydantic import SecretStr

from server.recruitment.prolific_webhook import receive
from server.simulate.fake_prolific import FakeProlific, create_app
from server.simulate.fake_prolific_hooks import Hooks
from server.simulate.fake_prolific_market import RESERVED_S, Market
from server.simulate.fake_prolific_records import Refusal, Submission, cost, minor
from server.simulate.fake_prolific_weather import Weather
from tests.server.web.client import Client

KEY = "t0k3n"
AUTHORIZED = {"Authorization": f"Token {KEY}"}
STUDY: dict[str, Any] = {
    "name": "Drive",
    "description": "Drive a car.",
    "external_study_url": "https://x.example/s?P={{%PROLIFIC_PID%}}&S={{%STUDY_ID%}}&X={{%SESSION_ID%}}",
    "prolific_id_option": "url_parameters",
    "completion_codes": [
        {"code": "CDONE", "code_type": "COMPLETED", "actions": [{"action": "MANUALLY_REVIEW"}]},
        {"code": "CAUTO", "code_type": "OTHER", "actions": [{"action": "AUTOMATICALLY_APPROVE"}]},
        {"code": "CBACK", "code_type": "OTHER", "actions": [{"action": "REQUEST_RETURN"}]},
    ],
    "total_available_places": 2,
    "estimated_completion_time": 10,
    "maximum_allowed_time": 60,
    "reward": 200,
    "device_compatibility": ["desktop"],
}


@pytest.fixture
def market() -> Market:
    return Market(1)


@pytest.fixture
def study_id(market: Market) -> str:
    made = market.create_study(STUDY)
    market.move_study(made.id, "PUBLISH")
    return made.id


@pytest.fixture
def client(market: Market) -> Iterator[Client]:
    hooks = Hooks(1)
    yield authorized(FakeProlific(KEY, market, hooks=hooks))
    hooks.stop()


def authorized(fake: FakeProlific) -> Client:
    made = Client(create_app(fake))
    made.inner.headers.update(AUTHORIZED)
    return made


def begun(market: Market, study_id: str) -> Submission:
    return market.begin(market.take(study_id).id)


def handed_in(market: Market, study_id: str, code: str = "CDONE") -> Submission:
    return market.hand_in(begun(market, study_id).id, code)


def test_the_key_is_wanted(client: Client) -> None:
    assert client.get("/api/v1/studies/").status_code == 200
    for header in ({"Authorization": ""}, {"Authorization": KEY}, {"Authorization": "Token other"}):
        answer = client.get("/api/v1/studies/", headers=header)
        assert answer.status_code == 401
        assert answer.json()["error"]["status"] == 401


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"name": ""}, "name"),
        ({"reward": 0}, "reward"),
        ({"total_available_places": -1}, "total_available_places"),
        ({"maximum_allowed_time": 28}, "maximum_allowed_time"),
        ({"external_study_url": "x.example"}, "external_study_url"),
        ({"completion_codes": []}, "completion_codes"),
        ({"completion_codes": [STUDY["completion_codes"][0]] * 2}, "completion_codes"),
        (
            {
                "completion_codes": [
                    {
                        "code": "C",
                        "code_type": "OTHER",
                        "actions": [{"action": "MANUALLY_REVIEW"}, {"action": "AUTOMATICALLY_APPROVE"}],
                    }
                ]
            },
            "completion_codes",
        ),
    ],
)
def test_a_study_that_prolific_would_not_take_is_refused(
    client: Client, changes: Mapping[str, Any], named: str
) -> None:
    answer = client.post("/api/v1/studies/", json={**STUDY, **changes})
    assert answer.status_code == 400
    assert named in answer.json()["error"]["detail"]


@pytest.mark.parametrize(
    ("moves", "refused"),
    [
        ((), "PAUSE"),
        ((), "START"),
        ((), "STOP"),
        (("PUBLISH",), "PUBLISH"),
        (("PUBLISH",), "START"),
        (("PUBLISH", "PAUSE"), "PAUSE"),
        (("PUBLISH", "STOP"), "PUBLISH"),
        (("PUBLISH", "STOP"), "START"),
        (("PUBLISH",), "EXPLODE"),
    ],
)
def test_a_study_moves_only_as_documented(
    client: Client, market: Market, moves: tuple[str, ...], refused: str
) -> None:
    path = f"/api/v1/studies/{market.create_study(STUDY).id}/transition/"
    for move in moves:
        assert client.post(path, json={"action": move}).status_code == 200
    assert client.post(path, json={"action": refused}).status_code == 400


@pytest.mark.parametrize("code", ["", "CAUTO", "CBACK", "WRONG"])
def test_a_code_does_what_the_study_says(market: Market, study_id: str, code: str) -> None:
    submission = handed_in(market, study_id, code)
    assert submission.status == ("APPROVED" if code == "CAUTO" else "AWAITING REVIEW")
    assert submission.code == (code or "NOCODE")
    assert (submission.return_requested_s is not None) == (code == "CBACK")
    assert [each.kind for each in market.payments] == (["reward"] if code == "CAUTO" else [])


@pytest.mark.parametrize("state", ["RESERVED", "ACTIVE", "RETURNED", "TIMED-OUT", "REJECTED"])
def test_only_what_awaits_review_is_approved(
    client: Client, market: Market, study_id: str, state: str
) -> None:
    submission = market.take(study_id)
    submission.status = state
    answer = client.post(f"/api/v1/submissions/{submission.id}/transition/", json={"action": "APPROVE"})
    assert answer.status_code == 400
    assert market.payments == []


def test_approving_twice_pays_once(market: Market, study_id: str) -> None:
    submission = handed_in(market, study_id)
    for _ in range(3):
        assert market.move_submission(submission.id, {"action": "APPROVE"}).status == "APPROVED"
    assert [each.amount_minor for each in market.payments] == [200]


def test_a_rejection_needs_a_long_message_and_a_category(market: Market, study_id: str) -> None:
    submission = handed_in(market, study_id)
    long = {"action": "REJECT", "message": "x" * 100, "rejection_category": "OTHER"}
    for wrong in (long | {"message": "x" * 99}, long | {"rejection_category": ""}):
        with pytest.raises(Refusal):
            market.move_submission(submission.id, wrong)
    assert market.move_submission(submission.id, long).status == "REJECTED"


@pytest.mark.parametrize("attempt", ["begin", "hand_in", "give_back", "time_out"])
def test_who_is_done_does_nothing_more(client: Client, market: Market, study_id: str, attempt: str) -> None:
    submission = handed_in(market, study_id, "CAUTO")
    assert client.post(f"/fake/submissions/{submission.id}/{attempt}").status_code == 400
    assert submission.status == "APPROVED"


def test_a_reserved_place_runs_out_after_ten_minutes(market: Market, study_id: str) -> None:
    idle, active = market.take(study_id), begun(market, study_id)
    market.advance(RESERVED_S - 1)
    assert idle.status == "RESERVED"
    with pytest.raises(Refusal):
        market.take(study_id)
    market.advance(1)
    assert (idle.status, active.status) == ("TIMED-OUT", "ACTIVE")
    assert market.take(study_id).status == "RESERVED"


def test_time_runs_out_as_the_study_says(market: Market, study_id: str) -> None:
    submission = begun(market, study_id)
    market.advance(60 * 60 - 1)
    assert market.submission(submission.id).status == "ACTIVE"
    market.advance(1)
    assert market.submission(submission.id).status == "TIMED-OUT"


def test_a_participant_takes_part_once(market: Market, study_id: str) -> None:
    market.take(study_id, "p1")
    with pytest.raises(Refusal, match="already"):
        market.take(study_id, "p1")


def test_a_full_study_waits_for_review_then_ends_and_comes_back(market: Market, study_id: str) -> None:
    people = [handed_in(market, study_id) for _ in range(2)]
    assert market.study(study_id).status == "AWAITING REVIEW"
    for each in people:
        market.move_submission(each.id, {"action": "APPROVE"})
    assert market.study(study_id).status == "COMPLETED"
    market.change_study(study_id, {"total_available_places": 3})
    assert market.study(study_id).status == "ACTIVE"


def test_publishing_takes_its_time() -> None:
    market = Market(1, publishing_s=30)
    study = market.create_study(STUDY)
    assert market.move_study(study.id, "PUBLISH").status == "PUBLISHING"
    with pytest.raises(Refusal):
        market.take(study.id)
    market.advance(30)
    assert market.study(study.id).status == "ACTIVE"


def test_a_published_study_only_gets_more_places(market: Market, study_id: str) -> None:
    for change in ({"reward": 300}, {"total_available_places": 1}):
        with pytest.raises(Refusal):
            market.change_study(study_id, change)
    assert market.study(study_id).fields == STUDY


def test_the_entry_link_is_filled_in(market: Market, study_id: str) -> None:
    taken = market.take(study_id, "p1")
    assert market.entry_url(taken) == f"https://x.example/s?P=p1&S={study_id}&X={taken.id}"


def test_pages_have_twenty_and_end_with_404(client: Client, market: Market) -> None:
    study_id = market.create_study({**STUDY, "total_available_places": 25}).id
    market.move_study(study_id, "PUBLISH")
    for _ in range(25):
        market.take(study_id)
    pages = [
        client.get("/api/v1/submissions/", params={"study": study_id, "page": page}) for page in (1, 2, 3)
    ]
    assert [each.status_code for each in pages] == [200, 200, 404]
    assert [len(each.json()["results"]) for each in pages[:2]] == [20, 5]
    assert pages[0].json()["meta"] == {"count": 25}


# Money


@pytest.mark.parametrize(
    "lines", ["", "nobody,1.50", "{id},0", "{id},-1", "{id},x", "{id},1.005", "{id},nan", "{id}"]
)
def test_bonuses_that_cannot_be_are_refused(market: Market, study_id: str, lines: str) -> None:
    submission = handed_in(market, study_id)
    with pytest.raises(Refusal):
        market.set_up_bulk(study_id, lines.format(id=submission.id))


def test_a_bulk_paid_twice_pays_twice_and_the_books_say_so(
    client: Client, market: Market, study_id: str
) -> None:
    one, other = handed_in(market, study_id), handed_in(market, study_id)
    lines = f"{one.id},1.50\n{other.participant_id},0.05\n"
    made = client.post(
        "/api/v1/submissions/bonus-payments/", json={"study_id": study_id, "csv_bonuses": lines}
    )
    assert made.json()["total_amount"] == pytest.approx(155 * 1.396)
    assert market.payments == []
    for _ in range(2):
        assert client.post(f"/api/v1/bulk-bonus-payments/{made.json()['id']}/pay/").status_code == 202
    books = client.get("/fake/ledger").json()["submissions"]
    assert books[one.id]["bonuses"] == [150, 150]
    assert books[other.id]["bonuses"] == [5, 5]
    assert client.get(f"/api/v1/submissions/{one.id}/").json()["bonus_payments"] == [150, 150]


def test_two_bulks_at_once_are_too_many() -> None:
    market = Market(1, paying_s=0.5)
    study_id = market.create_study(STUDY).id
    market.move_study(study_id, "PUBLISH")
    bulk = market.set_up_bulk(study_id, f"{begun(market, study_id).id},1.00\n")
    answers: list[int] = []

    def pay() -> None:
        try:
            market.pay_bulk(bulk.id)
        except Refusal as refused:
            answers.append(refused.status)

    both = [threading.Thread(target=pay) for _ in range(2)]
    for each in both:
        each.start()
    for each in both:
        each.join()
    assert answers == [429]
    assert [each.amount_minor for each in market.payments] == [100]


def test_amounts_are_read_exactly() -> None:
    assert [minor(each) for each in ("1.50", "0.01", "1", 0.14, "12.3")] == [150, 1, 100, 14, 1_230]
    assert cost([100])["amount"] == 100


# Bad weather


def test_some_requests_are_too_many_and_nothing_is_done_then() -> None:
    market = Market(1)
    client = authorized(FakeProlific(KEY, market, Weather(1, limit_429=0.5)))
    answers = [client.post("/api/v1/studies/", json=STUDY) for _ in range(60)]
    codes = [each.status_code for each in answers]
    assert set(codes) == {201, 429}
    assert 15 < codes.count(429) < 45
    assert len(market.studies) == codes.count(201)
    waits = {each.headers.get("Retry-After") for each in answers if each.status_code == 429}
    assert waits == {None, "1"}


@pytest.mark.parametrize(("when", "made"), [("before", 0), ("after", 1)])
def test_a_planned_fault_loses_the_thing_or_only_its_answer(
    client: Client, market: Market, when: str, made: int
) -> None:
    client.post("/fake/faults", json={"match": "POST /api/v1/studies/", "status": 502, "when": when})
    assert client.post("/api/v1/studies/", json=STUDY).status_code == 502
    assert len(market.studies) == made
    assert client.post("/api/v1/studies/", json=STUDY).status_code == 201


def test_equal_seeds_give_equal_markets() -> None:
    ids = []
    for seed in (1, 1, 2):
        market = Market(seed)
        study = market.create_study(STUDY)
        market.move_study(study.id, "PUBLISH")
        ids.append((study.id, market.take(study.id).participant_id))
    assert ids[0] == ids[1] != ids[2]


# Webhooks


class Mailbox:
    """Keeps what is delivered; the first `failures` deliveries fail."""

    def __init__(self, failures: int = 0) -> None:
        self.got: list[tuple[Mapping[str, str], bytes]] = []
        self.failures = failures

    def __call__(self, _: str, headers: Mapping[str, str], body: bytes) -> int:
        self.got.append((headers, body))
        self.failures -= 1
        return 200 if self.failures < 0 else 500


def lived_through(mailbox: Mailbox, seed: int = 3, people: int = 20, **hooks: Any) -> Hooks:
    """Twenty people take a place, begin and hand in; all that is sent of it arrives."""
    made = Hooks(seed, secret="s3cret", send=mailbox, **hooks)
    market = Market(seed, on_change=made.tell)
    made.subscribe("https://x.example/hook", confirmed=True)
    study = market.create_study({**STUDY, "total_available_places": people})
    market.move_study(study.id, "PUBLISH")
    for _ in range(people):
        handed_in(market, study.id)
    assert made.wait()
    made.stop()
    return made


def test_every_change_is_sent_and_signed() -> None:
    mailbox = Mailbox()
    lived_through(mailbox, twice=0, late=0)
    changes = [receive(SecretStr("s3cret"), headers, body, time()) for headers, body in mailbox.got]
    assert [each.submission.state for each in changes[:3] if each] == [
        "reserved",
        "active",
        "awaiting_review",
    ]
    assert len(changes) == 60
    assert None not in changes


def test_some_messages_come_twice_with_one_id_and_some_out_of_order() -> None:
    mailbox = Mailbox()
    lived_through(mailbox, twice=0.3, late=0.5, late_s=0.2)
    seen = defaultdict(set)
    for headers, body in mailbox.got:
        seen[headers["X-Event-ID"]].add(body)
    happened = [float(headers["X-Timestamp"]) for headers, _ in mailbox.got]
    assert len(seen) == 60
    assert len(mailbox.got) > 60
    assert all(len(bodies) == 1 for bodies in seen.values())
    assert happened != sorted(happened)


def test_what_was_not_taken_is_sent_again() -> None:
    mailbox = Mailbox(failures=1)
    lived_through(mailbox, people=1, twice=0, late=0)
    ids = [headers["X-Event-ID"] for headers, _ in mailbox.got]
    assert len(ids) == 4
    assert ids[0] in ids[1:]


def test_nobody_is_told_before_the_subscription_is_confirmed() -> None:
    mailbox = Mailbox()
    hooks = Hooks(1, secret="s3cret", send=mailbox)
    made = hooks.subscribe("https://x.example/hook")
    hooks.tell(Submission("a1", "s1", "p1", 0.0))
    with pytest.raises(Refusal):
        hooks.confirm(made.id, "guess")
    assert hooks.confirm(made.id, made.confirmation).is_enabled
    hooks.tell(Submission("a2", "s1", "p1", 0.0))
    assert hooks.wait()
    hooks.stop()
    assert {b"a2" in body for _, body in mailbox.got} == {True}


# The page


def test_a_person_walks_the_whole_way_by_hand(client: Client, market: Market, study_id: str) -> None:
    assert f"/page/take/{study_id}" in client.get("/").text
    entry = client.post(f"/page/take/{study_id}")
    (submission,) = market.of_study(study_id)
    assert entry.status_code == 303
    assert entry.headers["Location"] == market.entry_url(submission)
    assert submission.status == "ACTIVE"
    done = client.get("/submissions/complete?cc=CDONE")
    assert "Handed in with the code CDONE" in done.text
    assert (submission.status, submission.code) == ("AWAITING REVIEW", "CDONE")
    assert "Nothing was handed in" in client.get("/submissions/complete?cc=CDONE").text


@pytest.mark.parametrize(
    ("button", "status"),
    [("time_out", "TIMED-OUT"), ("give_back", "RETURNED"), ("hand_in", "AWAITING REVIEW")],
)
def test_every_button_does_what_it_says(
    client: Client, market: Market, study_id: str, button: str, status: str
) -> None:
    submission = begun(market, study_id)
    assert f"/page/{button}/{submission.id}" in client.get("/").text
    assert client.post(f"/page/{button}/{submission.id}").headers["Location"] == "/"
    assert submission.status == status


def test_the_page_shows_names_as_text_and_its_style_is_there(client: Client, market: Market) -> None:
    market.create_study({**STUDY, "name": "<b>&"})
    page = client.get("/").text
    assert "&lt;b&gt;&amp;" in page
    for style in re.findall(r'href="(/static/[^"]+)"', page):
        assert client.get(style).status_code == httpx.codes.OK
