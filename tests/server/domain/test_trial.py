"""A trial is a fold: live and from its events it is the same; what cannot have happened is refused."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from models.envs import registry
from models.vocabulary import SILENT
from server.domain import events, trial
from server.domain.errors import CorruptError
from server.domain.events import Move, Said, Saw
from server.domain.opening import opening
from server.domain.spec import Condition, Panel, TrialSpec
from server.domain.trial import Trial

SAW = Saw(0, 0, 0, 0, None, None)
PANEL = Panel(
    bundle="b",
    sha256="s",
    positions=tuple((0.1 * i, 0.1 * i) for i in range(9)),
    position_of_token=(1, 2, 3, 4, 5, 6, 7, 8, 0),
    number_at_position=(9, 8, 7, 6, 5, 4, 3, 2, 1),
)


def spec(role: str, seed: int = 5, **changes: Any) -> TrialSpec:
    driver = role == "driver"
    seats = ["policy"] * (10 if driver else 2)
    seats[0 if role == "parent" else -1] = "human"
    condition = {
        "communication": "prototype",
        "budget": 1.0,
        "overlay": True,
        "step_limit": 40 if driver else 20,
        "arrival": 0.05,
        "child_sees_parent": True,
        "panel": None if driver else PANEL,
        "blank": False,
    }
    values = {
        "task": "traffic_junction/medium" if driver else "parent_child",
        "task_version": 1,
        "seed": seed,
        "start": "human" if driver else "init",
        "role": role,
        "phase": "main",
        "bundle": {"name": "x/y", "sha256": "s"},
        "scripted": None,
        "seats": seats,
        "condition": Condition(**(condition | changes)),
    }
    return TrialSpec.model_validate(values)


def begin(role: str, seed: int = 5, **changes: Any) -> Trial:
    begun = trial.start(spec(role, seed, **changes))
    said = Said((SILENT, 4), (False, True)) if role == "parent" else events.silence(begun.env.agents)
    return trial.spoken(begun, said)


def decision(action: int, moves: list[Move], token: int | None = None) -> dict[str, Any]:
    return events.decision_body(action, token, {}, tuple(moves), SAW, "")


def drive(now: Trial, action: int) -> tuple[Trial, dict[str, Any]]:
    """The participant acts; all others gas; nobody speaks."""
    actions = [0] * 9 + [action]
    after = trial.spoken(trial.moved(now, tuple(actions)), events.silence(10))
    return after, decision(action, [Move(tuple(actions), after.said)])


def same(one: Trial, other: Trial) -> bool:
    worlds = (one.world, other.world)
    return (
        one.spec == other.spec
        and all(
            np.array_equal(getattr(worlds[0], f.name), getattr(worlds[1], f.name)) for f in fields(one.world)
        )
        and all(
            getattr(one, f) == getattr(other, f)
            for f in ("said", "cell", "trail", "step", "progress", "outcome", "held")
        )
    )


@pytest.mark.parametrize("seed", range(12))
def test_a_drive_folds_from_its_events_to_what_it_was(seed: int) -> None:
    live, bodies = begin("driver", seed), []
    while not live.over:
        live, body = drive(live, action=int(live.step % 3 == 2))
        bodies.append(body)
    folded = begin("driver", seed)
    for body in bodies:
        folded = trial.apply(folded, body)
    assert same(live, folded)
    assert live.outcome in {"arrived", "collision", "limit"}


def outcomes(choose: Any, seeds: range, **changes: Any) -> dict[int, Trial]:
    ends = {}
    for seed in seeds:
        now = begin("driver", seed, **changes)
        while not now.over:
            now, _ = drive(now, choose(now))
        ends[seed] = now
    return ends


def test_a_car_that_waits_at_its_entrance_is_never_hit_and_reaches_the_limit() -> None:
    for end in outcomes(lambda _: 1, range(20), step_limit=9).values():
        assert (end.outcome, end.progress, end.step) == ("limit", 0, 9)


def test_arrival_counts_the_whole_route_and_a_collision_the_cells_until_then() -> None:
    ends = outcomes(lambda _: 0, range(40))
    assert {end.outcome for end in ends.values()} == {"arrived", "collision"}
    for end in ends.values():
        if end.outcome == "arrived":
            assert end.progress == end.step == len(end.route)
            assert end.cell == end.route[-1]
        else:
            assert end.progress == end.step
            assert end.cell == end.route[end.progress]


def test_a_crash_of_others_does_not_end_the_trial() -> None:
    for seed in range(60):
        now = begin("driver", seed)
        while not now.over:
            now, _ = drive(now, 1)
            if now.world.crashed[0] and not now.world.collided_ever[0, 9]:
                assert now.outcome in {None, "limit"}
                return
    raise AssertionError("no crash of others in 60 drives")


def walk(now: Trial, actions: list[int]) -> Trial:
    for action in actions:
        said = now.held or events.silence(2)
        moved = trial.moved(now, (action, 4))
        now = trial.spoken(moved, events.silence(2) if moved.over else said)
    return now


def test_a_parent_who_walks_to_the_child_finds_it() -> None:
    now = begin("parent")
    world = now.world
    down = int(world.child_row[0] - world.parent_row[0])
    right = int(world.child_col[0] - world.parent_col[0])
    path = [2 if down > 0 else 0] * abs(down) + [1 if right > 0 else 3] * abs(right)
    end = walk(now, path)
    assert end.outcome == "found"
    assert end.step == len(path)
    assert len(end.trail) == len(path) + 1
    assert end.choices == ()


def test_a_parent_who_stays_does_not_find_it_within_the_limit() -> None:
    end = walk(begin("parent"), [4] * 20)
    assert (end.outcome, end.step) == ("not_found", 20)
    assert walk(begin("parent", step_limit=7), [4] * 7).outcome == "not_found"


def test_the_child_chooses_by_number_and_the_whole_walk_is_one_decision() -> None:
    now = begin("child")
    token = PANEL.token_of(3)
    assert PANEL.number_of(token) == 3
    held = Said((SILENT, token), (False, True))
    moves = [Move((4, 4), held)] * 19 + [Move((4, 4), events.silence(2))]
    end = trial.apply(now, decision(3, moves, token))
    assert (end.outcome, end.step, end.token) == ("not_found", 20, token)


def refused(now: Trial, body: dict[str, Any]) -> str:
    with pytest.raises(CorruptError) as caught:
        trial.apply(now, body)
    return caught.value.detail


def test_what_cannot_have_happened_is_refused() -> None:
    now = begin("driver")
    quiet = events.silence(10)
    gas = Move((0,) * 10, quiet)
    assert "not on offer" in refused(now, decision(2, [gas]))
    assert "the decision was 1" in refused(now, decision(1, [gas]))
    assert "missing" in refused(now, decision(0, []))
    assert "stopped" in refused(now, decision(0, [gas, gas]))
    assert "legal action" in refused(now, decision(0, [Move((0,) * 9 + (7,), quiet)]))
    empty = int(np.flatnonzero(~now.world.alive[0])[0]) if not now.world.alive[0].all() else None
    if empty is not None:
        actions = [0] * 10
        actions[empty] = 1
        assert f"empty seat {empty}" in refused(now, decision(0, [Move(tuple(actions), quiet)]))
        tokens = [SILENT] * 10
        tokens[empty] = 3
        ghostly = Move((0,) * 10, Said(tuple(tokens), (False,) * 10))
        assert f"seat {empty} is empty" in refused(now, decision(0, [ghostly]))
    assert "sent nothing" in refused(
        now, decision(0, [Move((0,) * 10, Said((SILENT,) * 10, (False,) * 9 + (True,)))])
    )


def test_a_walk_must_go_on_to_its_end_and_keep_its_sign() -> None:
    now, token = begin("child"), PANEL.token_of(3)
    held = Said((SILENT, token), (False, True))
    assert "missing" in refused(now, decision(3, [Move((4, 4), held)] * 5, token))
    other = Said((SILENT, (token + 1) % 9), (False, True))
    assert "held" in refused(now, decision(3, [Move((4, 4), other)], token))
    assert "token" in refused(now, decision(3, [Move((4, 4), held)], token + 1))


def test_nothing_follows_the_end_of_a_trial() -> None:
    end = walk(begin("parent"), [4] * 20)
    assert "after the end" in refused(end, decision(0, [Move((0, 4), events.silence(2))]))


def test_another_version_of_the_task_is_not_replayed_as_this_one() -> None:
    with pytest.raises(CorruptError, match="version 99"):
        trial.start(spec("driver").model_copy(update={"task_version": 99}))


def test_a_spec_reads_back_from_its_json() -> None:
    for role in ("parent", "child", "driver"):
        whole = spec(role)
        assert TrialSpec.model_validate_json(whole.model_dump_json()) == whole


def test_alone_nobody_else_ever_drives() -> None:
    env = registry.make("traffic_junction/medium")
    seeds = np.arange(30, dtype=np.uint64)
    state = opening(env, "alone", seeds, 0.7).state
    assert len(set(state.route[:, 9].tolist())) > 5
    for _ in range(12):
        assert np.array_equal(env.alive(state), np.arange(10) == np.full((30, 1), 9))
        state, _ = env.step(state, np.zeros((30, 10), np.int32))


def test_an_opening_that_a_world_does_not_have_is_refused() -> None:
    with pytest.raises(CorruptError):
        opening(registry.make("parent_child"), "human", np.array([1], np.uint64), 0.05)
