"""Message rates in stretches of five steps, counted by hand."""

import numpy as np
import pytest

from models.bursts import Windows, bursts, windows
from models.envs import registry
from models.evaluate import Question, survey
from models.policies.team import Team
from models.rollout import Rollout
from tests.models.interpret.speakers import Honest

MEDIUM = registry.make("traffic_junction/medium")


def talk(sent: list[int]) -> Rollout:
    """One agent that lives throughout and says this, step by step."""
    gates = np.array(sent, np.bool_)[:, None, None]
    nothing = np.zeros(gates.shape, np.int32)
    return Rollout(
        nothing, np.ones_like(gates), nothing, gates, nothing, nothing.astype(np.float32),
        np.zeros((len(sent) + 1, 1, 1), np.bool_), np.zeros((len(sent) + 1, 1, 1), np.bool_),
        np.array([True]), np.array([len(sent)], np.int32), np.array([1], np.int32), nothing, nothing,
    )  # fmt: skip


def test_who_saves_its_messages_up_is_found_out() -> None:
    everyone = np.ones(1, np.bool_)
    even = bursts(windows(talk([1, 0, 0, 0, 0] * 3), everyone))
    saved = bursts(windows(talk([0] * 12 + [1, 1, 1]), everyone))
    assert even is not None
    assert saved is not None
    assert (even.least, even.most) == (0.2, 0.2)
    assert (saved.least, saved.most) == (0.0, 0.6)
    assert saved.by_start[-3:] == (0.2, 0.4, 0.6)
    assert saved.single_quantiles["q50"] == 0.0


def test_windows_in_which_nobody_lives_have_no_rate() -> None:
    counted = Windows(np.array([[1.0, 0.0], [2.0, 0.0]]), np.array([[2.0, 0.0], [2.0, 0.0]]))
    found = bursts(counted)
    assert found is not None
    assert found.by_start == (0.75, None)
    assert (found.single_least, found.single_most) == (0.5, 1.0)
    assert bursts(Windows(np.zeros((1, 2)), np.zeros((1, 2)))) is None


def test_who_always_talks_has_no_quiet_stretch() -> None:
    found = survey(MEDIUM, Team(MEDIUM, Honest(MEDIUM)), Question(20)).bursts
    assert found is not None
    assert found.least == found.most == found.single_least == pytest.approx(1)
    assert len(found.by_start) == MEDIUM.steps_max - 4
