"""What every recruiter promises, whichever its marketplace.

A marketplace's tests inherit `RecruiterContract` and give it a fixture `marketplace`: a `Marketplace` with a
fresh recruiter and somebody who plays the people. What a marketplace does not have is left out of `can`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol
from urllib.parse import parse_qsl, urlsplit

import pytest

from server.recruitment.recognition import recognise
from server.recruitment.recruiter import Bonus, Posted, Posting, Recruiter, RecruiterError

EVERYTHING = frozenset({"see active", "see returned", "ask for return", "screen out"})

POSTING = Posting(
    slug="traffic-junction",
    title="Drive with robots",
    description="You drive a car through a crossing.",
    entry_url="https://study.example.org/s/traffic-junction",
    places=3,
    duration_min=20,
    time_limit_min=60,
    reward_minor=300,
    currency="GBP",
    codes={"complete": "CDONE", "screened_out": "CSCREEN", "failed": "CFAIL", "withdrawn": "CLEFT"},
)


MORE_THAN_A_PAGE = 101


class NoPlaceError(Exception):
    """The person found no place."""


@dataclass(frozen=True, slots=True)
class Taken:
    """A place that somebody took, and the link that was opened."""

    submission_id: str
    external_id: str
    entry_url: str


class People(Protocol):
    """The other side of the marketplace, and its books."""

    def take(self, posting_id: str) -> Taken:
        """Somebody new takes a place and opens the link; NoPlaceError if there is none."""
        ...

    def hand_in(self, taken: Taken, code: str) -> None: ...

    def give_back(self, taken: Taken) -> None: ...

    def rewards(self, taken: Taken) -> int:
        """How often the reward was paid."""
        ...

    def bonuses(self, taken: Taken) -> Sequence[int]:
        """Every bonus that was paid, in minor units."""
        ...


@dataclass(frozen=True, slots=True)
class Marketplace:
    recruiter: Recruiter
    people: People
    can: frozenset[str] = EVERYTHING
    posting: Posting = POSTING

    def open_study(self, **changes: object) -> Posted:
        return self.recruiter.publish(self.recruiter.create(replace(self.posting, **changes)).id)  # type: ignore[arg-type]

    def finished(self, posting_id: str) -> Taken:
        """Somebody who took part and was approved."""
        taken = self.people.take(posting_id)
        self.people.hand_in(taken, "CDONE")
        self.recruiter.approve(taken.submission_id)
        return taken

    def state_of(self, posting_id: str, taken: Taken) -> str:
        return next(
            each.state for each in self.recruiter.submissions(posting_id) if each.id == taken.submission_id
        )

    def needs(self, ability: str) -> None:
        if ability not in self.can:
            pytest.skip(f"{self.recruiter.marketplace} cannot {ability}")


def bonus(taken: Taken, amount_minor: int, request: str) -> Bonus:
    return Bonus(taken.submission_id, taken.external_id, amount_minor, "for good driving", request)


class RecruiterContract:
    # Studies

    def test_a_draft_recruits_nobody(self, marketplace: Marketplace) -> None:
        draft = marketplace.recruiter.create(marketplace.posting)
        assert draft.state == "draft"
        assert marketplace.recruiter.posted(draft.id) == draft
        with pytest.raises(NoPlaceError):
            marketplace.people.take(draft.id)

    def test_the_same_draft_made_twice_is_one(self, marketplace: Marketplace) -> None:
        first = marketplace.recruiter.create(marketplace.posting)
        assert marketplace.recruiter.create(marketplace.posting).id == first.id
        assert marketplace.recruiter.create(replace(marketplace.posting, reward_minor=301)).id != first.id

    def test_publishing_lets_people_in_and_twice_is_once(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        assert posted.state == "active"
        assert posted.places == marketplace.posting.places
        assert marketplace.recruiter.publish(posted.id) == posted
        assert marketplace.people.take(posted.id).submission_id

    def test_the_entry_link_says_who_comes(self, marketplace: Marketplace) -> None:
        taken = marketplace.people.take(marketplace.open_study().id)
        link = urlsplit(taken.entry_url)
        arrival = recognise(dict(parse_qsl(link.query)))
        assert f"{link.scheme}://{link.netloc}{link.path}" == marketplace.posting.entry_url
        assert arrival.marketplace == marketplace.recruiter.marketplace
        assert (arrival.external_id, arrival.submission_id) == (taken.external_id, taken.submission_id)
        assert not arrival.preview

    def test_a_pause_lets_nobody_in_but_those_who_began_finish(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        inside = marketplace.people.take(posted.id)
        assert marketplace.recruiter.pause(posted.id).state == "paused"
        assert marketplace.recruiter.pause(posted.id).state == "paused"
        with pytest.raises(NoPlaceError):
            marketplace.people.take(posted.id)
        marketplace.people.hand_in(inside, "CDONE")
        marketplace.recruiter.approve(inside.submission_id)
        assert marketplace.people.rewards(inside) == 1

    def test_after_a_pause_it_goes_on(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        marketplace.recruiter.pause(posted.id)
        assert marketplace.recruiter.publish(posted.id).state == "active"
        assert marketplace.people.take(posted.id)

    def test_places_are_added_and_never_taken_away(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        assert marketplace.recruiter.set_places(posted.id, 5).places == 5
        assert marketplace.recruiter.set_places(posted.id, 5).places == 5
        with pytest.raises(RecruiterError):
            marketplace.recruiter.set_places(posted.id, 4)
        assert marketplace.recruiter.posted(posted.id).places == 5

    def test_a_full_study_takes_people_again_after_more_places(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study(places=1)
        marketplace.finished(posted.id)
        with pytest.raises(NoPlaceError):
            marketplace.people.take(posted.id)
        assert marketplace.recruiter.set_places(posted.id, 2).state == "active"
        assert marketplace.people.take(posted.id)

    # Submissions

    def test_everybody_is_told_however_many_pages(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study(places=MORE_THAN_A_PAGE)
        expected = set()
        for _ in range(MORE_THAN_A_PAGE):
            taken = marketplace.people.take(posted.id)
            marketplace.people.hand_in(taken, "CDONE")
            expected.add((taken.submission_id, taken.external_id, "awaiting_review", "CDONE"))
        told = [
            (each.id, each.external_id, each.state, each.code)
            for each in marketplace.recruiter.submissions(posted.id)
        ]
        assert len(told) == MORE_THAN_A_PAGE
        assert set(told) == expected

    def test_nobody_yet_is_nobody(self, marketplace: Marketplace) -> None:
        assert list(marketplace.recruiter.submissions(marketplace.open_study().id)) == []

    def test_who_has_begun_is_active(self, marketplace: Marketplace) -> None:
        marketplace.needs("see active")
        posted = marketplace.open_study()
        taken = marketplace.people.take(posted.id)
        assert marketplace.state_of(posted.id, taken) == "active"

    def test_a_place_given_back_is_told_and_free_again(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study(places=1)
        taken = marketplace.people.take(posted.id)
        marketplace.people.give_back(taken)
        assert marketplace.people.take(posted.id).submission_id != taken.submission_id
        marketplace.needs("see returned")
        assert marketplace.state_of(posted.id, taken) == "returned"

    def test_an_approval_pays_once_however_often_it_is_given(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        taken = marketplace.finished(posted.id)
        marketplace.recruiter.approve(taken.submission_id)
        assert marketplace.people.rewards(taken) == 1
        assert marketplace.state_of(posted.id, taken) == "approved"

    def test_who_has_not_handed_in_is_approved_later(self, marketplace: Marketplace) -> None:
        taken = marketplace.people.take(marketplace.open_study().id)
        with pytest.raises(RecruiterError) as caught:
            marketplace.recruiter.approve(taken.submission_id)
        assert caught.value.again
        assert marketplace.people.rewards(taken) == 0
        marketplace.people.hand_in(taken, "CDONE")
        marketplace.recruiter.approve(taken.submission_id)
        assert marketplace.people.rewards(taken) == 1

    def test_asking_for_a_return_twice_is_harmless(self, marketplace: Marketplace) -> None:
        marketplace.needs("ask for return")
        taken = marketplace.people.take(marketplace.open_study().id)
        marketplace.people.hand_in(taken, "CLEFT")
        marketplace.recruiter.ask_for_return(taken.submission_id, "You left early.")
        marketplace.recruiter.ask_for_return(taken.submission_id, "You left early.")
        marketplace.people.give_back(taken)
        marketplace.recruiter.ask_for_return(taken.submission_id, "You left early.")
        assert marketplace.people.rewards(taken) == 0

    def test_what_was_paid_cannot_be_asked_back(self, marketplace: Marketplace) -> None:
        marketplace.needs("ask for return")
        taken = marketplace.finished(marketplace.open_study().id)
        with pytest.raises(RecruiterError):
            marketplace.recruiter.ask_for_return(taken.submission_id, "You left early.")

    def test_screening_out_ends_the_submission_and_twice_is_once(self, marketplace: Marketplace) -> None:
        marketplace.needs("screen out")
        posted = marketplace.open_study(places=1)
        taken = marketplace.people.take(posted.id)
        marketplace.recruiter.screen_out(posted.id, [taken.submission_id])
        marketplace.recruiter.screen_out(posted.id, [taken.submission_id, taken.submission_id])
        assert marketplace.state_of(posted.id, taken) == "screened_out"
        assert marketplace.people.rewards(taken) == 0
        assert marketplace.people.take(posted.id)

    def test_who_was_paid_is_not_screened_out(self, marketplace: Marketplace) -> None:
        marketplace.needs("screen out")
        posted = marketplace.open_study()
        paid, inside = marketplace.finished(posted.id), marketplace.people.take(posted.id)
        with pytest.raises(RecruiterError):
            marketplace.recruiter.screen_out(posted.id, [inside.submission_id, paid.submission_id])
        assert marketplace.state_of(posted.id, inside) == "active"

    # Money

    @pytest.mark.parametrize("amount_minor", [1, 9, 10, 99, 100, 101, 1_005, 12_345])
    def test_a_bonus_arrives_to_the_penny(self, marketplace: Marketplace, amount_minor: int) -> None:
        posted = marketplace.open_study()
        taken = marketplace.finished(posted.id)
        paid = marketplace.recruiter.pay_bonuses(posted.id, [bonus(taken, amount_minor, "r1")])
        assert [each.request for each in paid] == ["r1"]
        assert all(each.reference for each in paid)
        assert list(marketplace.people.bonuses(taken)) == [amount_minor]

    def test_the_same_request_is_paid_once_however_often_it_is_sent(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        taken = marketplace.finished(posted.id)
        same = bonus(taken, 50, "r1")
        assert len(marketplace.recruiter.pay_bonuses(posted.id, [same, same])) == 1
        again = marketplace.recruiter.pay_bonuses(posted.id, [same])
        assert [each.request for each in again] == ["r1"]
        assert list(marketplace.people.bonuses(taken)) == [50]

    def test_equal_bonuses_with_two_names_are_two(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        taken = marketplace.finished(posted.id)
        marketplace.recruiter.pay_bonuses(posted.id, [bonus(taken, 50, "r1")])
        marketplace.recruiter.pay_bonuses(posted.id, [bonus(taken, 50, "r2")])
        marketplace.recruiter.pay_bonuses(posted.id, [bonus(taken, 50, name) for name in ("r3", "r1", "r2")])
        assert list(marketplace.people.bonuses(taken)) == [50, 50, 50]

    def test_many_people_get_each_their_own(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        people = [marketplace.finished(posted.id) for _ in range(3)]
        wanted = [bonus(taken, 100 + index, f"r{index}") for index, taken in enumerate(people)]
        paid = marketplace.recruiter.pay_bonuses(posted.id, wanted)
        assert [each.request for each in paid] == ["r0", "r1", "r2"]
        assert [list(marketplace.people.bonuses(taken)) for taken in people] == [[100], [101], [102]]

    def test_nobody_is_paid_if_one_of_them_cannot_be(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        taken = marketplace.finished(posted.id)
        stranger = replace(taken, submission_id="0" * 24, external_id="f" * 24)
        with pytest.raises(RecruiterError):
            marketplace.recruiter.pay_bonuses(posted.id, [bonus(taken, 50, "r1"), bonus(stranger, 50, "r2")])
        assert list(marketplace.people.bonuses(taken)) == []

    @pytest.mark.parametrize("amount_minor", [0, -50])
    def test_no_money_is_no_bonus(self, marketplace: Marketplace, amount_minor: int) -> None:
        posted = marketplace.open_study()
        taken = marketplace.finished(posted.id)
        with pytest.raises(RecruiterError):
            marketplace.recruiter.pay_bonuses(
                posted.id, [bonus(taken, 50, "r1"), bonus(taken, amount_minor, "r2")]
            )
        assert list(marketplace.people.bonuses(taken)) == []

    def test_one_name_for_two_bonuses_is_refused(self, marketplace: Marketplace) -> None:
        posted = marketplace.open_study()
        taken = marketplace.finished(posted.id)
        with pytest.raises(RecruiterError):
            marketplace.recruiter.pay_bonuses(posted.id, [bonus(taken, 50, "r1"), bonus(taken, 60, "r1")])
        assert list(marketplace.people.bonuses(taken)) == []

    # Errors

    def test_what_is_not_there_is_said_in_one_line(self, marketplace: Marketplace) -> None:
        for attempt in (marketplace.recruiter.posted, marketplace.recruiter.publish):
            with pytest.raises(RecruiterError) as caught:
                attempt("0" * 24)
            assert "\n" not in str(caught.value)
            assert not caught.value.again
        with pytest.raises(RecruiterError):
            marketplace.recruiter.approve("0" * 24)
