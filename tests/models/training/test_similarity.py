from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from models.envs import registry
from models.training.config import Decoder
from models.training.similarity import TOPOGRAPHY, Reader, similarity_loss

SEARCH = registry.make("parent_child")
COORDINATES = Decoder(target="coordinates", reads="inbox")


def heard(message_of_place: Any) -> Any:
    """Nine searches, a row of the parent and one of the child each; the parent has heard the child."""
    child = np.arange(0, 81, 10, dtype=np.int32)
    state = SEARCH.place(np.arange(9, dtype=np.uint64), np.full(9, 5, np.int32), child)
    place = torch.tensor(np.stack([child // 9, child % 9], 1) / 8, dtype=torch.float32)
    inbox = torch.zeros(18, 4)
    inbox[::2] = message_of_place(place)
    return SimpleNamespace(
        states=(state, state),
        step=np.zeros(18, int),
        place=np.arange(18),
        hidden=torch.zeros(18, 3),
        inbox=inbox,
    )


def reader(*, vectors: bool) -> Reader:
    torch.manual_seed(0)
    return Reader(SEARCH, COORDINATES, hidden=3, message=4, vectors=vectors)


def reads_first_two(made: Reader) -> Reader:
    with torch.no_grad():
        made.read.weight.copy_(torch.eye(2, 4))
        made.read.bias.zero_()
        if made.write is not None:
            made.write.weight.copy_(torch.eye(4, 2))
            made.write.bias.zero_()
    return made


def cost(made: Reader, seen: Any, env: Any = SEARCH) -> float:
    return float(similarity_loss(env, made, seen).detach())


def first_two(place: torch.Tensor) -> torch.Tensor:
    return torch.cat((place, torch.zeros_like(place)), 1)


def test_a_message_that_is_its_place_costs_nothing() -> None:
    assert cost(reads_first_two(reader(vectors=True)), heard(first_two)) == 0


def test_what_does_not_follow_from_the_place_costs_its_square() -> None:
    def noisy(place: torch.Tensor) -> torch.Tensor:
        return first_two(place) + torch.tensor([0.0, 0.0, 2.0, 0.0])

    loss = cost(reads_first_two(reader(vectors=True)), heard(noisy))
    assert loss == pytest.approx(TOPOGRAPHY * 4)


def test_names_are_only_read_since_they_cannot_lie_like_places() -> None:
    made = reads_first_two(reader(vectors=False))
    assert made.write is None
    assert cost(made, heard(first_two)) == 0


def test_a_message_that_says_nothing_costs_the_squared_distance_of_the_guess() -> None:
    loss = cost(reads_first_two(reader(vectors=False)), heard(lambda _: torch.zeros(9, 4)))
    places = np.stack([np.arange(9), np.arange(9)]) / 8
    assert loss == pytest.approx((places**2).sum(axis=0).mean())


def hunted(env: Any, inbox_of_place: Any) -> Any:
    """Nine steps of a hunt in two episodes, a row of each seat; predators have heard where the prey is."""
    state = env.init(np.arange(2, dtype=np.uint64))
    place = np.tile(np.arange(2 * env.agents), 9)
    prey = torch.from_numpy(state.prey[place // env.agents].astype(np.int64))
    inbox = inbox_of_place(prey)
    inbox[place % env.agents == env.sought] = 9.0  # what the prey hears is nobody's business
    return SimpleNamespace(
        states=(state,) * 10,
        step=np.repeat(np.arange(9), 2 * env.agents),
        place=place,
        hidden=torch.zeros(len(place), 3),
        inbox=inbox,
    )


@pytest.mark.parametrize("task", ["predator_prey/5x5", "predator_prey/10x10"])
def test_predators_read_the_cell_of_the_prey(task: str) -> None:
    env = registry.make(task)
    made = Reader(env, Decoder(target="location", reads="inbox"), 3, env.cells, vectors=True)
    with torch.no_grad():
        made.read.weight.copy_(50 * torch.eye(env.cells))
        made.read.bias.zero_()

    def told(prey: torch.Tensor) -> torch.Tensor:
        return torch.nn.functional.one_hot(prey, env.cells).float()

    right = cost(made, hunted(env, told), env)
    wrong = cost(made, hunted(env, lambda prey: told((prey + 1) % env.cells)), env)
    assert right == pytest.approx(0, abs=1e-6)
    assert wrong == pytest.approx(50, abs=1e-3)


def test_predators_read_row_and_column_of_the_prey() -> None:
    env = registry.make("predator_prey/5x5")
    made = reads_first_two(Reader(env, COORDINATES, 3, 4, vectors=True))

    def told(prey: torch.Tensor) -> torch.Tensor:
        return first_two(torch.stack((prey // 5, prey % 5), 1) / 4)

    assert cost(made, hunted(env, told), env) == 0
