"""The table that moves people is total, leads everybody to an end, and rejects nobody."""

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.domain import participation
from server.domain.participation import BEFORE, ENDS, MOVES, STAGES, Event, State, after, moves, stage_of
from server.domain.plan import page_kind, plan
from tests.fakes import definition

EVENTS = st.lists(st.sampled_from(Event), max_size=30)
FINAL = {State.FINISHED, State.FAILED, State.DECLINED, State.SCREENED_OUT, State.WITHDRAWN, State.REJECTED}


@pytest.mark.parametrize(("state", "event"), list(product(State, Event)))
def test_every_event_leads_somewhere_from_every_state(state: State, event: Event) -> None:
    assert after(state, event) in State
    if not moves(state, event):
        assert after(state, event) is state


def test_every_state_is_before_a_stage_or_an_end_and_only_one_of_them() -> None:
    assert sorted([*BEFORE, *STAGES, *ENDS]) == sorted(State)


@given(EVENTS)
def test_whoever_came_to_a_final_end_stays_there(events: list[Event]) -> None:
    for start in FINAL:
        state = start
        for event in events:
            state = after(state, event)
        assert state is start


@given(EVENTS)
def test_nobody_is_rejected_unless_a_marketplace_says_so(events: list[Event]) -> None:
    state = State.INVITED
    for event in events:
        state = after(state, event)
    assert state is not State.REJECTED or Event.REJECTION_TOLD in events


def test_only_a_new_place_leads_from_an_end_back_into_the_study() -> None:
    back = {(s, e) for (s, e), target in MOVES.items() if s in ENDS and target not in ENDS}
    assert back == {(State.RETURNED, Event.TOOK_AGAIN), (State.TIMED_OUT, Event.TOOK_AGAIN)}


def test_every_state_can_be_reached_and_every_stage_can_be_left_by_every_way_out() -> None:
    reached = {State.INVITED}
    for _ in State:
        reached |= {target for (state, _), target in MOVES.items() if state in reached}
    assert reached == set(State)
    out = {
        Event.WITHDRAW: State.WITHDRAWN,
        Event.PLACE_LOST: State.TIMED_OUT,
        Event.RETURN_TOLD: State.RETURNED,
        Event.TIME_OUT_TOLD: State.TIMED_OUT,
        Event.REJECTION_TOLD: State.REJECTED,
    }
    for stage, (event, end) in product(STAGES, out.items()):
        assert after(stage, event) is end


def test_failing_the_quiz_screens_out_and_a_missed_try_moves_nobody() -> None:
    assert after(State.PRACTISED, Event.QUIZ_FAILED) is State.SCREENED_OUT
    assert all(after(state, Event.QUIZ_MISSED) is state for state in State)


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
def test_the_pages_of_a_whole_study_go_through_the_stages_in_order(slug: str) -> None:
    whole = definition(slug, whole=True)
    pages = plan(whole, whole.role_orders[0], 1).pages
    blocks = len(whole.role_orders[0].split("-"))
    found = []
    for page in pages[:-1]:
        kind, block = page_kind(page)
        begun = (False, True) if kind == "play" else (True,)
        found += [stage_of(page, last_block=block in {0, blocks}, begun=each) for each in begun]
    one_block = [State.CONSENTED, State.INSTRUCTED, State.PRACTISED, State.QUIZZED, State.PLAYING]
    between = [State.PLAYING] if blocks == 2 else []
    after_all = [State.SURVEYED] * (3 if slug == "parent-child" else 2)
    assert found == [*one_block, *between, *(one_block if blocks == 2 else []), *after_all]


def test_the_diagram_draws_every_move_once() -> None:
    drawn = participation.diagram()
    for (state, event), target in MOVES.items():
        [line] = [line for line in drawn.splitlines() if line.startswith(f"  {state} --> {target}:")]
        assert event.value.replace("_", " ") in line
    assert drawn.count("-->") == len({(s, t) for (s, _), t in MOVES.items()}) + 1 + len(ENDS)
