"""Information similarity: can the world be read off what was heard? An auxiliary loss, in training only.

Traffic Junction: occupancy of every road cell by the other cars now, and the cells that they would enter with
gas (their intent). Parent & Lost Child, Predator-Prey: the cell of whoever is sought, or its row and column,
read by the seekers; where messages are vectors, row and column are read from the message and the message is
predicted from row and column, so that near places get near messages. Shapes: M rows, C road cells, D message.

Source: Karten et al. 2023, information similarity; intent after the paper's section on Traffic Junction.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from models.envs.api import Environment
from models.envs.traffic_junction import TrafficJunction
from models.training.config import Decoder
from models.training.imitation import intent
from models.training.unroll import Unrolled

TOPOGRAPHY = 0.1  # weight of predicting the message: messages begin with variance 4, places with 0.2
RARE = -2.5  # first logit of a cell being occupied: about 1 in 12, as on medium


class Reader(nn.Module):
    """Predicts the target from the inbox, or from [second hidden, inbox]."""

    def __init__(
        self, env: Environment[Any], settings: Decoder, hidden: int, message: int, *, vectors: bool
    ) -> None:
        super().__init__()
        self.settings = settings
        two_ways = settings.target == "coordinates" and settings.reads == "inbox" and vectors
        self.write = nn.Linear(2, message) if two_ways else None
        size = target_size(env, settings)
        if settings.reads == "inbox":
            self.read: nn.Module = nn.Linear(message, size)
        else:
            self.read = nn.Sequential(nn.Linear(hidden + message, hidden), nn.ReLU(), nn.Linear(hidden, size))

        if settings.target == "occupancy":
            last = [layer for layer in self.read.modules() if isinstance(layer, nn.Linear)][-1]
            nn.init.constant_(last.bias, RARE)

    def forward(self, hidden: Tensor, inbox: Tensor) -> Tensor:
        heard = inbox if self.settings.reads == "inbox" else torch.cat((hidden, inbox), 1)
        return self.read(heard)  # type: ignore[no-any-return]


def target_size(env: Environment[Any], settings: Decoder) -> int:
    """Numbers that the reader predicts."""
    if settings.target == "occupancy":
        assert isinstance(env, TrafficJunction)
        return 2 * len(env.roads.road_cells)
    return 2 if settings.target == "coordinates" else env.cells


def similarity_loss(env: Environment[Any], reader: Reader, seen: Unrolled) -> Tensor:
    """Mean loss over the rows that listen: cross-entropy in nats (summed over cells), or squared error."""
    if reader.settings.target == "occupancy":
        assert isinstance(env, TrafficJunction)
        target = torch.from_numpy(occupancy(env, seen)).to(seen.hidden.device)
        read = reader(seen.hidden, seen.inbox)
        return nn.functional.binary_cross_entropy_with_logits(read, target, reduction="none").sum(1).mean()
    assert env.sought is not None
    seeks = seen.place % env.agents != env.sought
    rows = torch.from_numpy(np.flatnonzero(seeks))
    cell = torch.from_numpy(_sought_cell(env, env.sought, seen)[seeks]).to(seen.hidden.device)
    read = reader(seen.hidden[rows], seen.inbox[rows])
    if reader.settings.target == "location":
        return nn.functional.cross_entropy(read, cell)
    height, width = env.shape
    place = torch.stack((cell // width / (height - 1), cell % width / (width - 1)), 1)
    loss = (read - place).square().sum(1).mean()
    if reader.write is not None:
        loss = loss + TOPOGRAPHY * (reader.write(place) - seen.inbox[rows]).square().sum(1).mean()
    return torch.as_tensor(loss)


def occupancy(env: TrafficJunction, seen: Unrolled) -> np.ndarray[Any, np.dtype[np.float32]]:
    """(M, 2C): is another car on each road cell now; would another enter it with gas."""
    column = np.full(env.cells + 1, -1)
    column[env.roads.road_cells] = np.arange(len(env.roads.road_cells))
    now = np.stack([column[env.cell_of(state)] for state in seen.states[:-1]])  # (T, B, N)
    then = np.stack([column[intent(env, state)] for state in seen.states[:-1]])
    return np.concatenate([_others(part, len(env.roads.road_cells), seen) for part in (now, then)], 1)


def _others(columns: Any, size: int, seen: Unrolled) -> np.ndarray[Any, np.dtype[np.float32]]:
    """(M, C): whether any other living car has each column; columns (T, B, N), -1 for none."""
    batch, seats = columns.shape[1:]
    counted = seen.living & (columns >= 0)
    step, episode, _ = np.nonzero(counted)
    count = np.zeros((len(columns), batch, size), np.int16)
    np.add.at(count, (step, episode, columns[counted]), 1)
    rows = count[seen.step, seen.place // seats]  # (M, C)
    own = columns.reshape(len(columns), -1)[seen.step, seen.place]
    has = np.flatnonzero(own >= 0)
    rows[has, own[has]] -= 1
    return np.asarray(rows > 0, np.float32)


def _sought_cell(env: Environment[Any], sought: int, seen: Unrolled) -> np.ndarray[Any, np.dtype[np.int64]]:
    """(M,) cell of the seat that is sought, at each row's step and episode."""
    cells = np.stack([env.cell_of(state)[:, sought] for state in seen.states[:-1]])  # (T, B)
    return np.asarray(cells[seen.step, seen.place // env.agents], np.int64)
