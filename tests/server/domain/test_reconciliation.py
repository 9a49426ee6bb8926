"""Every pair of states has a result; money is proposed only where it is owed, and nobody is ever rejected."""

from dataclasses import replace
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.domain.participation import ACTIVE, ENDS
from server.domain.reconciliation import (
    MONEY,
    ActionKind,
    Mismatch,
    Ours,
    OverCapError,
    Site,
    Theirs,
    check_caps,
    mismatches,
)
from server.domain.study import Pay
from server.recruitment.recruiter import SubmissionState

PAY = Pay(
    reward_minor=300,
    partial_minor=50,
    screen_out_minor=20,
    bonus_success_minor=5,
    bonus_max_minor=100,
    cap_participant_minor=400,
    cap_study_minor=1_000,
)
STATUSES = [ACTIVE, *(state.value for state in ENDS)]
STATES = get_args(SubmissionState)


def ours(status: str, bonus: int = 0, code: str = "CODE") -> Ours:
    return Ours("P1", "h1", "s1", status, code, bonus, partial_minor=50)


def between(status: str, state: str, bonus: int = 0, code: str = "CODE") -> list[Mismatch]:
    return mismatches([ours(status, bonus)], [Theirs("s1", "h1", state, code)], {}, PAY)


@pytest.mark.parametrize("status", STATUSES)
@pytest.mark.parametrize("state", STATES)
def test_every_pair_of_states_is_defined_and_nobody_is_rejected(status: str, state: str) -> None:
    found = between(status, state, bonus=20)
    assert all(each.action in get_args(ActionKind) for each in found)
    assert "reject" not in " ".join(get_args(ActionKind))
    assert len({each.key for each in found}) == len(found)


@pytest.mark.parametrize("status", STATUSES)
@pytest.mark.parametrize("state", STATES)
def test_the_reward_is_proposed_only_for_who_went_through_and_waits(status: str, state: str) -> None:
    proposed = [each for each in between(status, state) if each.action == "approve"]
    owed = status in {"finished", "failed"} and state == "awaiting_review"
    assert [each.amount_minor for each in proposed] == ([300] if owed else [])


@pytest.mark.parametrize(
    ("status", "state", "actions"),
    [
        ("active", "active", []),
        ("active", "returned", ["follow"]),
        ("active", "timed_out", ["follow"]),
        ("active", "awaiting_review", ["ask_return"]),
        ("active", "approved", ["look"]),
        ("finished", "active", []),
        ("finished", "awaiting_review", ["approve", "bonus"]),
        ("finished", "approved", ["bonus"]),
        ("finished", "returned", ["look"]),
        ("failed", "awaiting_review", ["approve", "bonus"]),
        ("screened_out", "awaiting_review", ["screen_out"]),
        ("screened_out", "screened_out", []),
        ("screened_out", "returned", []),
        ("withdrawn", "awaiting_review", ["partial", "ask_return"]),
        ("withdrawn", "returned", ["partial"]),
        ("declined", "active", ["ask_return"]),
        ("declined", "returned", []),
        ("timed_out", "awaiting_review", ["ask_return"]),
        ("timed_out", "timed_out", []),
        ("rejected", "rejected", []),
    ],
)
def test_each_difference_has_its_proposal(status: str, state: str, actions: list[str]) -> None:
    assert [each.action for each in between(status, state, bonus=20)] == actions


def test_who_never_came_but_handed_in_is_asked_to_return() -> None:
    found = mismatches([], [Theirs("s1", "h1", "awaiting_review", "X")], {}, PAY)
    assert [(each.action, each.participant_id) for each in found] == [("ask_return", "")]
    assert mismatches([], [Theirs("s1", "h1", "active", "")], {}, PAY) == []


def test_who_declined_is_known_by_the_hash_alone() -> None:
    refused = Ours("", "h1", "", "screened_out", "", 0)
    (found,) = mismatches([refused], [Theirs("s1", "h1", "awaiting_review", "X")], {}, PAY)
    assert (found.action, found.amount_minor) == ("screen_out", 20)


def test_a_second_submission_of_the_same_person_is_named() -> None:
    told = [Theirs("s1", "h1", "approved", "CODE"), Theirs("s2", "h1", "awaiting_review", "CODE")]
    (found,) = mismatches([ours("finished")], told, {}, PAY)
    assert (found.submission_id, found.action) == ("s2", "ask_return")


def test_an_old_submission_that_was_given_back_is_no_difference() -> None:
    told = [Theirs("s0", "h1", "returned", ""), Theirs("s1", "h1", "active", "")]
    assert mismatches([ours(ACTIVE)], told, {}, PAY) == []


def test_who_is_unknown_there_is_looked_into() -> None:
    (found,) = mismatches([ours("finished")], [], {}, PAY)
    assert (found.action, found.theirs) == ("look", "unknown")


def test_another_code_stops_the_money() -> None:
    assert [each.action for each in between("finished", "awaiting_review", 20, code="OTHER")] == ["look"]


def test_without_pay_nothing_that_costs_is_proposed() -> None:
    found = mismatches([ours("finished", 20)], [Theirs("s1", "h1", "approved", "CODE")], {}, None)
    assert found == []


@given(st.sampled_from(STATUSES), st.sampled_from(STATES), st.integers(0, 100))
def test_what_was_done_is_never_proposed_again(status: str, state: str, bonus: int) -> None:
    found = between(status, state, bonus)
    ledger = {each.key: "done" for each in found if each.action in MONEY}
    again = mismatches([ours(status, bonus)], [Theirs("s1", "h1", state, "CODE")], ledger, PAY)
    assert not [each for each in again if each.action in MONEY]


@given(st.integers(1, 500), st.integers(0, 500), st.integers(0, 1_500))
def test_caps_hold_for_person_and_study(amount: int, person: int, study: int) -> None:
    fits = person + amount <= 400 and study + amount <= 1_000
    if fits:
        check_caps(PAY, amount, person, study)
    else:
        with pytest.raises(OverCapError):
            check_caps(PAY, amount, person, study)


@pytest.mark.parametrize(
    ("status", "state", "proposed"),
    [
        ("withdrawn", "awaiting_review", [("approve", 300)]),
        ("withdrawn", "approved", []),
        ("timed_out", "awaiting_review", [("look", 0)]),
        (ACTIVE, "awaiting_review", [("look", 0)]),
        ("finished", "awaiting_review", [("approve", 300)]),
    ],
)
def test_where_only_the_whole_reward_can_be_paid_nothing_is_paid_beside_it(
    status: str, state: str, proposed: list[tuple[str, int]]
) -> None:
    whole = Site(lists_everybody=False, pays_in_parts=False)
    found = mismatches([ours(status)], [Theirs("s1", "h1", state, "CODE")], {}, PAY, whole)
    assert [(each.action, each.amount_minor) for each in found] == proposed


def test_who_came_in_by_another_posting_need_not_be_in_this_ones_list() -> None:
    other = replace(ours("finished"), must_be_listed=False)
    assert mismatches([other], [], {}, PAY) == []
    (second,) = mismatches([other], [Theirs("s2", "h1", "awaiting_review", "")], {}, PAY)
    assert (second.submission_id, second.action) == ("s2", "ask_return")
