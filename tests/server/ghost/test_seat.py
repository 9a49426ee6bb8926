"""The ghost's seat: the team runs in every seat, also in the human's, and remembers what was recorded."""

from typing import Any

import numpy as np
import pytest

from models.envs import registry, starts
from models.envs.api import Environment
from models.policies import scripted
from models.policies.team import Team
from models.vocabulary import SILENT
from server.domain.events import Said, silence
from server.domain.opening import opening
from server.ghost.seat import Minds, ScriptedCrew, TrainedCrew
from tests.fakes import fake_bundle

MEDIUM = registry.make("traffic_junction/medium")
SEARCH = registry.make("parent_child")
SEEDS = [3, 11, 2**52 + 1]


def crew(name: str = "traffic_junction/budget-050", env: Environment[Any] = MEDIUM) -> TrainedCrew:
    return TrainedCrew(env, fake_bundle(name).policy)


def begun(seed: int) -> Any:
    return opening(MEDIUM, "human", np.array([seed], np.uint64), 0.05)


def memory(minds: Minds) -> Any:
    assert minds.memory is not None
    return minds.memory.hidden


@pytest.mark.parametrize("seed", SEEDS)
def test_a_team_comes_to_the_trial_with_the_memory_of_its_own_warm_up(seed: int) -> None:
    here = begun(seed)
    team = Team(MEDIUM, fake_bundle("traffic_junction/budget-050").policy)
    human = starts.human_start(MEDIUM, np.array([seed], np.uint64))
    expected = team.start(1)
    for state, _ in human.warmup:
        talk, expected = team.speak(state, expected)
        _, expected = team.act(state, expected, talk)
    assert len(human.warmup) >= 12
    np.testing.assert_array_equal(memory(crew().begin(here)), expected.hidden)
    assert memory(crew().begin(here)).any()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_ghost_speaks_in_the_participants_seat_too(seed: int) -> None:
    here = begun(seed)
    said, minds = crew().speak(here.state, crew().begin(here))
    assert here.state.alive[0, 9]
    assert said.tokens[9] != SILENT
    assert memory(minds)[0, 9].any()


@pytest.mark.parametrize("seed", SEEDS)
def test_empty_seats_are_silent_and_do_nothing(seed: int) -> None:
    here = begun(seed)
    said, minds = crew().speak(here.state, crew().begin(here))
    actions, _ = crew().act(here.state, minds, said)
    for seat, alive in enumerate(here.state.alive[0]):
        if not alive:
            assert (said.tokens[seat], said.gates[seat], actions[seat]) == (SILENT, False, 0)


def test_what_is_heard_is_what_was_recorded() -> None:
    """Other tokens in the record lead to other memories: the minds are rerun over the record."""
    here = begun(SEEDS[0])
    said, minds = crew().speak(here.state, crew().begin(here))
    speaker = int(np.flatnonzero(here.state.alive[0])[0])
    tokens, gates = list(said.tokens), [True] * 10
    tokens[speaker] = (tokens[speaker] + 1) % 16
    gates = [gate and token != SILENT for gate, token in zip(gates, tokens, strict=True)]
    _, one = crew().act(here.state, minds, Said(said.tokens, tuple(gates)))
    _, two = crew().act(here.state, minds, Said(tuple(tokens), tuple(gates)))
    assert not np.array_equal(memory(one), memory(two))


def test_minds_are_values_that_nothing_changes() -> None:
    here = begun(SEEDS[1])
    minds = crew().begin(here)
    before = memory(minds).copy()
    said, spoken = crew().speak(here.state, minds)
    crew().act(here.state, spoken, said)
    np.testing.assert_array_equal(memory(minds), before)


def test_a_scripted_child_points_at_the_same_blank_sign_at_every_step() -> None:
    state = SEARCH.init(np.array([8], np.uint64))
    script = ScriptedCrew(SEARCH, scripted.make("scripted:seeker"), signs=9)
    signs = []
    for _ in range(5):
        said, minds = script.speak(state, Minds(None))
        signs.append(said.tokens[1])
        actions, _ = script.act(state, minds, said)
        state, _ = SEARCH.step(state, np.array([actions], np.int32))
        assert said.tokens[0] == SILENT
        assert said.gates == (False, True)
    assert len(set(signs)) == 1
    assert 0 <= signs[0] < 9


def test_blank_signs_are_drawn_from_all_of_them_and_say_nothing_of_the_place() -> None:
    script = ScriptedCrew(SEARCH, scripted.make("scripted:seeker"), signs=9)
    worlds = (SEARCH.init(np.array([seed], np.uint64)) for seed in range(300))
    tokens = [script.speak(world, Minds(None))[0].tokens[1] for world in worlds]
    assert set(tokens) == set(range(9))


def test_on_the_practice_road_nobody_speaks() -> None:
    state = opening(MEDIUM, "alone", np.array([1], np.uint64), 0.0).state
    script = ScriptedCrew(MEDIUM, scripted.make("scripted:always-gas"), signs=0)
    said, minds = script.speak(state, Minds(None))
    assert said == silence(10)
    assert script.act(state, minds, said)[0] == [0] * 10
