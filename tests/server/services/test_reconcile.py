"""Recruiting at the made-up Prolific: what is told moves people, and money is paid once."""

import contextlib
import hashlib
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

import pytest
from pydantic import SecretStr
from sqlalchemy import update

from server.domain import reconciliation
from server.domain.errors import BadInputError, NotReadyError
from server.domain.reconciliation import check_caps
from server.recruitment.prolific_api import ProlificRecruiter
from server.recruitment.recruiter import Change, RecruiterError, Submission
from server.services import enrol, erase, leave, reconcile, recruit
from server.services.lab import Lab
from server.services.reconcile import Outcome
from server.services.session import session_of
from server.services.verify import verify
from server.simulate.fake_prolific import FakeProlific, running
from server.simulate.fake_prolific_market import Market
from server.simulate.fake_prolific_weather import Weather
from server.storage import journeys, postings, studies
from server.storage.database import Database
from server.storage.tables import participant, payment
from tests.fakes import FakeClock, definition, fake_lab
from tests.server.recruitment.contract import Taken
from tests.server.recruitment.prolific_people import FakePeople
from tests.server.services.steps import DESKTOP, launch, person, play_all

TOKEN = "t0k3n-of-the-tests"
SLUG = "traffic-junction"
PAY = {
    "currency": "GBP",
    "reward_minor": 300,
    "partial_minor": 50,
    "screen_out_minor": 20,
    "bonus_success_minor": 10,
    "bonus_max_minor": 10,
    "cap_participant_minor": 400,
    "cap_study_minor": 2_000,
}
CODES = {"screened_out": "SCREENED", "failed": "", "withdrawn": "LEFT-EARLY"}


@dataclass
class Site:
    """A study at the fake marketplace, and the people there."""

    lab: Lab
    people: FakePeople
    posting_id: int

    @property
    def external_id(self) -> str:
        return recruit.opened(self.lab, self.posting_id).row.external_id

    def arrive(self) -> tuple[Taken, str]:
        """Somebody takes a place there and consents here; the key of the session."""
        taken = self.people.take(self.external_id)
        params = dict(pair.split("=") for pair in taken.entry_url.partition("?")[2].split("&"))
        with self.lab.database.writing() as db:
            result = enrol.consent(db, self.lab, SLUG, params, agree=True, device=DESKTOP)
        assert isinstance(result, enrol.Enrolled)
        return taken, result.key

    def finish(self) -> tuple[Taken, str]:
        taken, key = self.arrive()
        play_all(self.lab, key)
        self.people.hand_in(taken, person(self.lab, key).completion_code or "")
        return taken, key

    def found(self) -> reconcile.Found:
        recruit.poll(self.lab, self.posting_id)
        with self.lab.database.reading() as db:
            return reconcile.look(db, self.lab, self.posting_id)

    def proposed(self) -> list[tuple[str, int]]:
        return [(each.action, each.amount_minor) for each in self.found().mismatches]

    def confirm_all(self, action: str = "") -> list[Outcome]:
        keys = [key for key in reconcile.confirmable(self.found()) if key.startswith(action)]
        return reconcile.confirm(self.lab, self.posting_id, keys, "ada")


def site_at(url: str, people: FakePeople, database: Database, **changes: Any) -> Site:
    """A fresh study, published with three places."""
    lab = fake_lab(database)
    settings = lab.settings.model_copy(
        update={"prolific_api": f"{url}/api/v1", "prolific_token": SecretStr(TOKEN)}
    )
    lab = replace(lab, settings=settings)
    launch(lab, definition(SLUG, **{"trials_per_block": 1, "pay": PAY, "codes": CODES} | changes))
    name = hashlib.sha256(str(database.url).encode()).hexdigest()[:8]
    posting_id = recruit.create(lab, SLUG, "prolific", 3, f"Drive a car. {name}")
    recruit.publish(lab, posting_id)
    return Site(lab, people, posting_id)


@pytest.fixture
def url() -> Iterator[str]:
    with running(FakeProlific(TOKEN, Market(1), Weather(1))) as served:
        yield served


@pytest.fixture
def people(url: str) -> Iterator[FakePeople]:
    made = FakePeople(url)
    yield made
    made.close()


@pytest.fixture
def site(url: str, people: FakePeople, database: Database) -> Site:
    return site_at(url, people, database)


def won(site: Site, key: str) -> int:
    from server.services import pages

    with site.lab.database.reading() as db:
        return pages.page_of(db, site.lab, person(site.lab, key)).progress.bonus_minor


def test_who_finished_is_paid_exactly_once_however_often_it_is_confirmed(site: Site) -> None:
    taken, key = site.finish()
    bonus = won(site, key)
    expected = [("approve", 300)] + ([("bonus", bonus)] if bonus else [])
    assert site.proposed() == expected
    first = site.confirm_all()
    assert all(each.done for each in first), first
    assert site.people.rewards(taken) == 1
    assert list(site.people.bonuses(taken)) == ([bonus] if bonus else [])
    again = reconcile.confirm(site.lab, site.posting_id, [each.key for each in first], "bob")
    assert all(each.done for each in again)
    assert site.people.rewards(taken) == 1
    assert site.proposed() == []
    assert verify(site.lab).clean


def test_both_sides_agree_before_anybody_hands_in(site: Site) -> None:
    site.arrive()
    assert site.proposed() == []


def test_who_returns_the_place_there_leaves_here_and_may_come_back(site: Site) -> None:
    taken, key = site.arrive()
    site.people.give_back(taken)
    site.found()
    assert person(site.lab, key).status == "returned"
    params = {"PROLIFIC_PID": taken.external_id, "STUDY_ID": "s", "SESSION_ID": "another"}
    with site.lab.database.writing() as db:
        enrol.come_back(db, site.lab, key, params)
    assert person(site.lab, key).status == "active"
    with site.lab.database.reading() as db:
        told = journeys.of_participant(db, person(site.lab, key).id)
    assert [(row.event, row.source) for row in told[1:]] == [
        ("return_told", "prolific"),
        ("took_again", "prolific"),
    ]
    assert verify(site.lab).clean


def test_who_hands_in_without_finishing_is_asked_to_return_and_never_rejected(site: Site) -> None:
    taken, _ = site.arrive()
    site.people.hand_in(taken, "GUESSED")
    assert site.proposed() == [("ask_return", 0)]
    assert all(each.done for each in site.confirm_all())
    assert site.people.rewards(taken) == 0
    assert site.found().mismatches == ()


def test_another_code_than_was_shown_is_looked_into_by_a_person(site: Site) -> None:
    taken, key = site.arrive()
    play_all(site.lab, key)
    site.people.hand_in(taken, "OTHER")
    assert site.proposed() == [("look", 0)]
    (mismatch,) = site.found().mismatches
    (outcome,) = reconcile.confirm(site.lab, site.posting_id, [mismatch.key], "ada")
    assert not outcome.done
    assert site.people.rewards(taken) == 0


def test_who_withdraws_gets_the_partial_pay_and_is_asked_to_return(site: Site) -> None:
    taken, key = site.arrive()
    with site.lab.database.writing() as db:
        leave.withdraw(db, site.lab, enrol.participant_by_key(db, site.lab, key), keep=False)
    site.people.hand_in(taken, "LEFT-EARLY")
    assert site.proposed() == [("partial", 50), ("ask_return", 0)]
    assert all(each.done for each in site.confirm_all())
    assert list(site.people.bonuses(taken)) == [50]
    assert verify(site.lab).clean


def test_a_lost_answer_about_money_is_not_sent_again_before_it_can_be_told(
    url: str, people: FakePeople, sqlite_database: Database
) -> None:
    clock = FakeClock()
    site = site_at(url, people, sqlite_database)
    site.lab = replace(site.lab, now=clock)
    taken, key = site.arrive()
    with site.lab.database.writing() as db:
        leave.withdraw(db, site.lab, enrol.participant_by_key(db, site.lab, key), keep=True)
    people.plan_fault(match="/pay", status=500, when="after")
    (outcome,) = site.confirm_all("partial")
    assert not outcome.done
    assert [row.state for row in site.found().ledger] == ["sent"]
    (early,) = site.confirm_all("partial")
    assert not early.done
    assert "too" in early.says or "later" in early.says
    assert list(people.bonuses(taken)) == [50]
    clock.now += timedelta(hours=2)
    (late,) = site.confirm_all("partial")
    assert late.done, late
    assert list(people.bonuses(taken)) == [50]
    assert [row.state for row in site.found().ledger] == ["done"]


def test_a_worker_that_died_while_paying_pays_once(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    taken, _ = site.finish()
    (key, *_) = reconcile.confirmable(site.found())

    def die(*_: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(reconcile, "end", die)
        with pytest.raises(KeyboardInterrupt):
            reconcile.confirm(site.lab, site.posting_id, [key], "ada")
    assert site.people.rewards(taken) == 1
    site.found()
    site.confirm_all()
    assert site.people.rewards(taken) == 1
    assert site.proposed() == []


def test_nothing_is_paid_beyond_the_caps(url: str, people: FakePeople, sqlite_database: Database) -> None:
    tight = {**PAY, "bonus_success_minor": 0, "bonus_max_minor": 0}
    tight |= {"cap_participant_minor": 300, "cap_study_minor": 300}
    site = site_at(url, people, sqlite_database, pay=tight)
    one, other = site.finish()[0], site.finish()[0]
    outcomes = site.confirm_all()
    assert sorted(each.done for each in outcomes) == [False, True]
    assert "cap for the study" in next(each.says for each in outcomes if not each.done)
    assert people.rewards(one) + people.rewards(other) == 1


def test_a_webhook_is_taken_once_and_an_old_one_does_not_bring_anybody_back(site: Site) -> None:
    taken, key = site.arrive()

    def told(event_id: str, state: Any) -> bool:
        said = Submission(taken.submission_id, taken.external_id, state)
        return recruit.take_change(site.lab, "prolific", Change(event_id, "", said))

    assert told("e1", "returned")
    assert not told("e1", "returned")
    assert person(site.lab, key).status == "returned"
    assert told("e0", "active")
    with site.lab.database.reading() as db:
        assert [row.state for row in postings.submissions(db, site.posting_id)] == ["returned"]


def test_a_webhook_about_nobody_here_is_left_alone(site: Site) -> None:
    said = Submission("elsewhere", "nobody", "active")
    assert not recruit.take_change(site.lab, "prolific", Change("e", "", said))


def test_a_later_version_does_not_change_a_bonus_that_was_promised(site: Site) -> None:
    _, key = site.finish()
    promised = won(site, key)
    newer(site, bonus_success_minor=5)
    with site.lab.database.reading() as db:
        (ada,) = reconcile.people(db, site.lab, recruit.place_of(db, site.lab, site.posting_id))
    assert ada.bonus_minor == promised == 10


def test_places_are_added_and_never_taken_away(site: Site) -> None:
    recruit.set_places(site.lab, site.posting_id, 5)
    assert recruit.opened(site.lab, site.posting_id).row.places == 5
    with pytest.raises(BadInputError, match="from 5 to"):
        recruit.set_places(site.lab, site.posting_id, 2)
    recruit.pause(site.lab, site.posting_id)
    assert recruit.opened(site.lab, site.posting_id).row.state == "paused"


def test_without_an_account_the_refusal_says_what_to_do(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database)
    launch(lab, definition(SLUG, pay=PAY))
    with pytest.raises(NotReadyError, match=r"docs/settings\.md"):
        recruit.create(lab, SLUG, "prolific", 3, "")


def test_a_study_without_pay_is_not_offered(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database)
    launch(lab, definition(SLUG))
    with pytest.raises(BadInputError, match="states no pay"):
        recruit.create(lab, SLUG, "prolific", 3, "")


def test_robots_and_tests_are_never_reconciled_with_people(site: Site) -> None:
    taken, key = site.finish()
    with site.lab.database.writing() as db:
        db.write(update(participant).values(mode="robot"))
        assert session_of(db, site.lab, enrol.participant_by_key(db, site.lab, key))
    assert site.proposed() == [("ask_return", 0)]
    assert site.people.rewards(taken) == 0


def newer(site: Site, **pay: int) -> None:
    """The same study launched once more, with another pay."""
    changed = definition(SLUG, trials_per_block=1, codes=CODES, pay=PAY | pay)
    with site.lab.database.writing() as db:
        study = studies.by_slug(db, SLUG)
        assert study is not None
        studies.add_version(db, study.id, changed.canonical, changed.sha256, site.lab.now_utc())


def withdrawn(site: Site) -> Taken:
    taken, key = site.arrive()
    with site.lab.database.writing() as db:
        leave.withdraw(db, site.lab, enrol.participant_by_key(db, site.lab, key), keep=True)
    return taken


def test_a_later_version_does_not_change_what_approving_costs(site: Site) -> None:
    site.finish()
    newer(site, reward_minor=350)
    assert ("approve", PAY["reward_minor"]) in site.proposed()


def test_a_later_version_does_not_change_the_partial_pay_that_was_promised(site: Site) -> None:
    withdrawn(site)
    newer(site, partial_minor=90)
    assert ("partial", 50) in site.proposed()


def test_a_payment_that_was_begun_is_tried_again_with_its_own_amount(
    url: str, people: FakePeople, sqlite_database: Database
) -> None:
    clock = FakeClock()
    site = site_at(url, people, sqlite_database)
    site.lab = replace(site.lab, now=clock)
    taken = withdrawn(site)
    people.plan_fault(match="/pay", status=500)
    site.confirm_all("partial")
    with site.lab.database.writing() as db:
        db.write(update(payment).values(amount_minor=40))
    assert list(people.bonuses(taken)) == []
    clock.now += timedelta(hours=2)
    (late,) = site.confirm_all("partial")
    assert late.done, late
    assert list(people.bonuses(taken)) == [40]


def test_people_of_a_study_that_went_live_after_it_was_posted_are_paid(
    url: str, people: FakePeople, sqlite_database: Database
) -> None:
    site = site_at(url, people, sqlite_database)
    with site.lab.database.writing() as db:
        study = studies.by_slug(db, SLUG)
        assert study is not None
        studies.set_mode(db, study.id, "test")
    site.finish()
    with site.lab.database.writing() as db:
        studies.set_mode(db, study.id, "live")
    site.finish()
    assert [action for action, _ in site.proposed() if action != "bonus"] == ["approve", "approve"]


def test_a_second_posting_of_a_study_does_not_miss_the_people_of_the_first(site: Site) -> None:
    site.arrive()
    site.found()
    other = recruit.create(site.lab, SLUG, "prolific", 2, "The same again, later in the year.")
    assert other != site.posting_id
    recruit.poll(site.lab, other)
    with site.lab.database.reading() as db:
        assert reconcile.look(db, site.lab, other).mismatches == ()


TIGHT = {**PAY, "cap_study_minor": 500}


def test_two_postings_paid_at_once_stay_within_the_cap_of_their_study(
    url: str, people: FakePeople, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = site_at(url, people, database, pay=TIGHT)
    other = replace(one, posting_id=recruit.create(one.lab, SLUG, "prolific", 3, "The same again, at once."))
    recruit.publish(other.lab, other.posting_id)
    taken = [one.finish()[0], other.finish()[0]]
    keys = [
        [each.key for each in site.found().mismatches if each.action == "approve"] for site in (one, other)
    ]
    both = threading.Barrier(2)

    def within(*amounts: Any) -> None:
        """Both are within the cap before either is written down, unless one has to wait for the other."""
        check_caps(*amounts)
        with contextlib.suppress(threading.BrokenBarrierError):
            both.wait(timeout=1)

    monkeypatch.setattr(reconciliation, "check_caps", within)
    with ThreadPoolExecutor(2) as pool:
        paying = [
            pool.submit(reconcile.confirm, site.lab, site.posting_id, mine, "ada")
            for site, mine in zip((one, other), keys, strict=True)
        ]
    outcomes = [each for future in paying for each in future.result()]
    assert sorted(each.done for each in outcomes) == [False, True]
    assert "cap for the study" in next(each.says for each in outcomes if not each.done)
    assert sum(people.rewards(each) for each in taken) == 1


def test_a_person_is_not_erased_while_a_payment_to_them_begins(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken, key = site.finish()
    keys = [each.key for each in site.found().mismatches if each.action == "approve"]
    who = person(site.lab, key)
    begun, noticed = threading.Event(), threading.Event()

    def begin_payment(*row: Any) -> None:
        begin(*row)
        begun.set()
        noticed.wait(timeout=1)  # written down and not yet to be seen: whoever erases has to wait for it

    def erase_now() -> None:
        begun.wait(timeout=10)
        with site.lab.database.writing() as db:
            known = erase.find_participant(db, site.lab, SLUG, who.id)
            try:
                erase.erase(db, known)
            finally:
                noticed.set()

    begin = postings.begin_payment
    monkeypatch.setattr(postings, "begin_payment", begin_payment)
    with ThreadPoolExecutor(2) as pool:
        paying = pool.submit(reconcile.confirm, site.lab, site.posting_id, keys, "ada")
        erasing = pool.submit(erase_now)
    assert [each.done for each in paying.result()] == [True]
    assert site.people.rewards(taken) == 1
    refused = erasing.exception()
    if refused is None:  # it came after the end of the payment: the amount stays
        with site.lab.database.reading() as db:
            assert sum(postings.spent(db, who.study_id).values()) == PAY["reward_minor"]
    else:
        assert "on its way" in str(refused)
        assert person(site.lab, key).id == who.id


def test_a_person_whom_the_marketplace_does_not_remember_keeps_nobody_else_from_being_taken_in(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def refuses_the_first(_: ProlificRecruiter, __: str, external_id: str) -> None:
        asked.append(external_id)
        if len(asked) == 1:
            raise RecruiterError("not this worker")

    monkeypatch.setattr(ProlificRecruiter, "remember", refuses_the_first)
    site.finish()
    site.arrive()
    with pytest.raises(recruit.MarketplaceError, match="not this worker"):
        recruit.poll(site.lab, site.posting_id)
    assert len(asked) == 2
    with site.lab.database.reading() as db:
        states = sorted(row.state for row in postings.submissions(db, site.posting_id))
    assert states == ["active", "awaiting_review"]
