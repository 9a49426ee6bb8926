from dataclasses import fields, replace

import numpy as np
import pytest

from models.envs import starts
from models.envs.api import take
from models.envs.registry import make
from models.envs.right_of_way import right_of_way
from models.envs.starts import HumanStart, human_start
from models.envs.traffic_junction import BRAKE, GAS, NEVER, TrafficJunction, TrafficState
from models.policies import scripted

ENV = TrafficJunction("medium")
B = 400
SELF = ENV.agents - 1


@pytest.fixture(scope="module")
def begun() -> HumanStart:
    return human_start(ENV, np.arange(B, dtype=np.uint64))


def _equal(one: TrafficState, other: TrafficState) -> bool:
    return all(np.array_equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))


def _last_warmup(begun: HumanStart, b: int) -> TrafficState:
    """Return the state in which the participant joined, one step on from the last warm-up action."""
    state, actions = begun.warmup[int(begun.length[b]) - 1]
    return ENV.step(take(state, slice(b, b + 1)), actions[b : b + 1])[0]


def test_the_participant_enters_at_position_zero_in_the_last_slot(begun: HumanStart) -> None:
    state = begun.state

    assert state.alive[:, SELF].all()
    assert state.fresh[:, SELF].all()
    assert not state.position[:, SELF].any()
    assert not state.age[:, SELF].any()
    assert (state.guest == SELF).all()


def test_five_to_nine_others_drive_each_number_equally_often() -> None:
    many = human_start(ENV, np.arange(3000, dtype=np.uint64))
    others = many.state.alive.sum(1) - 1

    assert np.array_equal(others, many.cars)
    assert np.bincount(many.cars, minlength=10)[5:] / 3000 == pytest.approx(0.2, abs=0.03)
    assert np.bincount(many.state.route[:, SELF], minlength=12) / 3000 == pytest.approx(1 / 12, abs=0.02)


def test_nobody_shares_a_cell_and_the_episode_begins_without_a_collision(begun: HumanStart) -> None:
    assert not ENV.collided(begun.state).any()
    assert not begun.state.collided_ever.any()
    assert ENV.success(begun.state).all()
    assert not ENV.done(begun.state).any()


def test_the_warmup_is_what_the_world_does_under_its_actions(begun: HumanStart) -> None:
    first = begun.warmup[0][0]
    assert not first.alive.any()
    assert not first.t.any()
    for step, (state, actions) in enumerate(begun.warmup[:-1]):
        following = begun.warmup[step + 1][0]
        goes_on = step + 1 < begun.length
        assert _equal(take(ENV.step(state, actions)[0], goes_on), take(following, goes_on))
        assert np.array_equal(actions[begun.active(step)], right_of_way(ENV, state)[begun.active(step)])
    for b in range(B):
        before, after = _last_warmup(begun, b), take(begun.state, slice(b, b + 1))
        assert np.array_equal(before.position, after.position)
        assert np.array_equal(before.alive[:, :SELF], after.alive[:, :SELF])
        assert np.array_equal(before.fresh[:, :SELF], after.fresh[:, :SELF])


def test_episodes_that_are_through_their_warmup_wait_in_their_first_state(begun: HumanStart) -> None:
    state, actions = begun.warmup[-1]
    waiting = ~begun.active(len(begun.warmup) - 1)

    assert waiting.any()
    assert _equal(take(state, waiting), take(begun.state, waiting))
    assert (actions[waiting] == BRAKE).all()


def test_the_participants_slot_stays_empty_during_the_warmup(begun: HumanStart) -> None:
    for step, (state, _) in enumerate(begun.warmup):
        assert not state.alive[begun.active(step), SELF].any()


def test_the_participant_enters_at_the_first_possible_step(begun: HumanStart) -> None:
    """Written once more from the rule, episode by episode."""
    for b in range(B):
        entry = ENV.routes[begun.state.route[b, SELF]][0]
        for step in range(12, int(begun.length[b])):
            state = begun.warmup[step][0]
            cells = ENV.cell_of(state)[b][state.alive[b]].tolist()
            full = len(cells) == begun.cars[b]
            assert not (full and entry not in cells and len(set(cells)) == len(cells))
        assert begun.length[b] >= 12
        assert begun.length[b] == begun.state.t[b]


def test_a_start_depends_on_its_own_seed_only(begun: HumanStart) -> None:
    some = np.array([311, 7, 52], np.uint64)
    others = human_start(ENV, some)
    alone = human_start(ENV, some[:1])

    assert _equal(others.state, take(begun.state, some.astype(int)))
    assert _equal(alone.state, take(others.state, slice(0, 1)))
    assert alone.length[0] == others.length[0] == len(alone.warmup)
    for step, (state, actions) in enumerate(alone.warmup):
        assert _equal(state, take(begun.warmup[step][0], slice(311, 312)))
        assert np.array_equal(actions, begun.warmup[step][1][311:312])


def test_a_warmup_that_takes_too_long_is_drawn_again(
    monkeypatch: pytest.MonkeyPatch, begun: HumanStart
) -> None:
    monkeypatch.setattr(starts, "WARMUP_MAX", 14)
    again = human_start(ENV, np.arange(B, dtype=np.uint64))
    late = begun.length > 14

    assert late.any()
    assert again.length.max() <= 14
    assert _equal(take(again.state, ~late), take(begun.state, ~late))
    assert (again.state.seed[late] != begun.state.seed[late]).all()


def test_collisions_of_the_warmup_are_over_and_forgotten_when_the_participant_enters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # the right-of-way rule hardly ever lets cars meet, random drivers do
    monkeypatch.setattr(starts, "right_of_way", scripted.Random().actions)
    wild = human_start(ENV, np.arange(100, dtype=np.uint64))
    crashed = np.array([any(state.crashed[b] for state, _ in wild.warmup) for b in range(100)])

    assert crashed.mean() > 0.5
    assert not ENV.collided(wild.state).any()
    assert not wild.state.collided_ever.any()
    assert ENV.success(wild.state).all()


def test_the_trial_goes_on_in_the_same_world_with_few_arrivals(begun: HumanStart) -> None:
    state, arrived = begun.state, 0
    for step in range(ENV.steps_max):
        assert not ENV.done(state).any()
        state, _ = ENV.step(state, right_of_way(ENV, state))
        arrived += state.fresh.sum()
        assert not (state.fresh[:, SELF]).any()
        assert (state.t == begun.length + step + 1).all()
    assert ENV.done(state).all()
    # 4 entrances; an arrival into the participant's own cell or a full crossing is lost
    assert arrived / (B * ENV.steps_max * 4) == pytest.approx(0.05, abs=0.004)


def test_no_start_is_doomed(begun: HumanStart) -> None:
    """With right of way everybody arrives; with a driver who only gasses about one in eleven crashes."""
    state, arrived = begun.state, np.zeros(B, np.bool_)
    for _ in range(ENV.steps_max):
        state, _ = ENV.step(state, right_of_way(ENV, state))
        arrived |= state.completed[:, SELF]

    assert ENV.success(state).all()
    assert arrived.all()


def test_no_car_arrives_in_the_participants_cell_while_it_waits() -> None:
    begun = human_start(ENV, np.arange(100, dtype=np.uint64), arrival=1.0)
    state = begun.state
    for _ in range(10):
        actions = right_of_way(ENV, state)
        actions[:, SELF] = BRAKE
        state, _ = ENV.step(state, actions)
        assert not ENV.collided(state)[:, SELF].any()


def test_without_arrivals_the_participant_ends_up_alone() -> None:
    state = human_start(ENV, np.arange(50, dtype=np.uint64), arrival=0.0).state
    for _ in range(ENV.steps_max - 1):
        actions = right_of_way(ENV, state)
        actions[:, SELF] = BRAKE
        state, _ = ENV.step(state, actions)

    assert (state.alive.sum(1) == 1).all()


def test_the_large_crossing_has_human_starts_too() -> None:
    env = make("traffic_junction/hard")
    begun = human_start(env, np.arange(30, dtype=np.uint64))

    assert begun.state.alive[:, -1].all()
    assert np.array_equal(begun.state.alive.sum(1) - 1, begun.cars)


def test_a_crossing_with_too_few_slots_is_refused() -> None:
    with pytest.raises(ValueError, match="needs 10 slots, traffic_junction/easy has 5"):
        human_start(make("traffic_junction/easy"), np.zeros(1, np.uint64))


def test_the_warmup_never_ends_by_itself(begun: HumanStart) -> None:
    state, _ = begun.warmup[0]
    assert (state.end == NEVER).all()
    assert (begun.state.end == begun.state.t + ENV.steps_max).all()
    moved, _ = ENV.step(replace(begun.state, t=begun.state.end), np.full((B, 10), GAS, np.int32))
    assert np.array_equal(moved.position, begun.state.position)
