import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from models.training.quantise import head_start
from models.training.reinforce import NAMES_WEIGHT, upkeep_of_names


def upkeep(logits: torch.Tensor, channel: str = "one-hot", uttered: list[bool] | None = None) -> float:
    net: Any = SimpleNamespace(architecture=SimpleNamespace(channel=channel))
    heard = np.ones(len(logits), bool) if uttered is None else np.array(uttered)
    seen: Any = SimpleNamespace(raw=logits, uttered=heard)
    return float(upkeep_of_names(net, seen)) / NAMES_WEIGHT


def test_clear_and_even_choices_cost_nothing() -> None:
    assert upkeep(100 * torch.eye(9)) == pytest.approx(0, abs=1e-5)


def test_one_name_for_everything_costs_all_there_is_to_say() -> None:
    same = torch.zeros(9, 9)
    same[:, 4] = 100
    assert upkeep(same) == pytest.approx(math.log(9))


def test_undecided_choices_cost_as_much_as_one_name() -> None:
    assert upkeep(torch.zeros(9, 9)) == pytest.approx(math.log(9))


def test_what_nobody_can_hear_does_not_count() -> None:
    rows = torch.cat((100 * torch.eye(9), torch.zeros(9, 9)))
    assert upkeep(rows, uttered=[True] * 9 + [False] * 9) == pytest.approx(0, abs=1e-5)


def test_other_channels_have_no_names() -> None:
    assert upkeep(torch.zeros(9, 9), channel="prototype") == 0


def test_rare_names_get_a_head_start_and_frequent_ones_lose_theirs() -> None:
    start = head_start(torch.tensor([0, 30, 100, 170]))
    assert start[0] == 1.0
    assert start.tolist() == sorted(start.tolist(), reverse=True)
    assert start[3] < 0
    assert float(head_start(torch.full((9,), 50)).abs().max()) == pytest.approx(0, abs=1e-6)
