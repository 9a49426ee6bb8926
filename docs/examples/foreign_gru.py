"""Train a parent and a child in plain torch, without hatlab's trainer, and write weights for `hatlab import`.

    python docs/examples/foreign_gru.py FOLDER [UPDATES]

What it is, truthfully: the language is made by hand, nothing emerges. Each of nine tokens names one of the
3x3 blocks of the 9x9 grid; its prototype is the block's (row, column) from -1 to 1. The child learns by
supervision to say its block, and the parent by imitation of a rule: walk to the middle of the block that was
named, and to the child once it is seen. Only the world is hatlab's.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from models.envs import registry
from models.envs.grid import towards
from models.envs.parent_child import CHILD, PARENT

HIDDEN, MESSAGE, TOKENS = 64, 2, 9
BATCH = 64
CODEBOOK = torch.tensor([[row, column] for row in (-1, 0, 1) for column in (-1, 0, 1)], dtype=torch.float32)
WORLD = registry.make("parent_child")


class Searchers(nn.Module):
    """One network for both seats."""

    def __init__(self) -> None:
        super().__init__()
        self.cell = nn.GRUCell(WORLD.observation_size + MESSAGE, HIDDEN)
        self.say = nn.Linear(HIDDEN, MESSAGE)
        self.think = nn.Linear(HIDDEN + MESSAGE, HIDDEN)
        self.walk = nn.Linear(HIDDEN, WORLD.actions)


def block(cell: np.ndarray) -> np.ndarray:
    """The token for a cell: which of the nine 3x3 blocks it is in."""
    return cell // 9 // 3 * 3 + cell % 9 // 3


def rule(parent: np.ndarray, child: np.ndarray) -> np.ndarray:
    """What a parent does that knows the child's block, and sees it within one cell."""
    near = np.maximum(abs(parent // 9 - child // 9), abs(parent % 9 - child % 9)) <= 1
    middle = np.stack((block(child) // 3 * 3 + 1, block(child) % 3 * 3 + 1))
    row, column = np.where(near, np.stack((child // 9, child % 9)), middle)
    return towards(parent // 9, parent % 9, row, column)


def lesson(net: Searchers, update: int) -> tuple[Tensor, int]:
    """Loss and length of a batch of searches: the network walks, the rule says what was right."""
    state = WORLD.init(np.arange(BATCH, dtype=np.uint64) + np.uint64(update * BATCH + 2**32))
    token = block(WORLD.cell_of(state)[:, CHILD])
    memory, heard = [torch.zeros(BATCH, HIDDEN)] * 2, torch.zeros(BATCH, MESSAGE)
    losses, steps = [], 0
    for step in range(WORLD.steps_max):
        seen = torch.from_numpy(WORLD.observe(state))
        memory[PARENT] = net.cell(torch.cat((seen[:, PARENT], heard), 1), memory[PARENT])
        if step == 0:  # the child speaks once, and its word is heard at every step
            memory[CHILD] = net.cell(torch.cat((seen[:, CHILD], heard), 1), memory[CHILD])
            losses.append(10 * (net.say(memory[CHILD]) - CODEBOOK[token]).square().mean())
        heard = CODEBOOK[token]
        logits = net.walk(net.think(torch.cat((memory[PARENT], heard), 1)).relu())
        cells = WORLD.cell_of(state)
        wanted = torch.from_numpy(rule(cells[:, PARENT], cells[:, CHILD]).astype(np.int64))
        going = torch.from_numpy(~WORLD.done(state)).float()
        steps += int(going.sum())
        losses.append((nn.functional.cross_entropy(logits, wanted, reduction="none") * going).mean())
        walk = torch.distributions.Categorical(logits=logits.detach()).sample().numpy().astype(np.int32)
        state, _ = WORLD.step(state, np.stack((walk, np.zeros_like(walk)), 1))
    return torch.stack(losses).sum(), steps


def train(updates: int) -> tuple[Searchers, int]:
    """Give the network and the environment steps that it saw."""
    torch.manual_seed(1)
    torch.set_num_threads(1)
    net = Searchers()
    adam = torch.optim.Adam(net.parameters(), lr=4e-3)
    fade = torch.optim.lr_scheduler.LinearLR(adam, 1.0, 0.05, updates)
    steps = 0
    for update in range(updates):
        loss, played = lesson(net, update)
        steps += played
        adam.zero_grad()
        loss.backward()
        adam.step()
        fade.step()
        if update % 50 == 0:
            print(f"update {update}: loss {loss.item():.3f}", flush=True)
    return net, steps


NAMES = {"cell.": "gru.", "say.": "speech.", "think.": "think.", "walk.": "act."}
"""Own names on the left, hatlab's (models/policies/plain.py) on the right."""


def export(net: Searchers, folder: Path, updates: int, steps: int) -> None:
    """Write plain arrays under the names that `hatlab import` knows, and what they are."""
    arrays = {"codebook": CODEBOOK.numpy()}
    for name, tensor in net.state_dict().items():
        own = next(prefix for prefix in NAMES if name.startswith(prefix))
        arrays[NAMES[own] + name.removeprefix(own)] = tensor.numpy()
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(folder / "weights.npz", **arrays)
    (folder / "policy.toml").write_text(f"""\
task = "parent_child"
architecture = "gru"
channel = "prototype"
gate = "open"
budget = 1.0
hidden = {HIDDEN}
message = {MESSAGE}
tokens = {TOKENS}
seed = 1
steps_trained = {steps}
source = "docs/examples/foreign_gru.py: torch.nn.GRUCell, {updates} updates"
supervised_help = "a language made by hand (nine blocks), and the labels of a rule that walks to the block"
""")


if __name__ == "__main__":
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 400
    trained, seen = train(count)
    export(trained, Path(sys.argv[1]), count, seen)
