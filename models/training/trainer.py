"""One training run: weights, optimiser, place in the recipe, the best so far, and all of it on disk.

A run lives in one folder: ``checkpoint.safetensors`` (replaced at each check) and ``log.csv`` (a line per
check). Killed at any moment, it goes on from its last check and ends with the same weights, on the same
machine.
"""

import copy
import csv
import hashlib
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.envs import registry
from models.policies import bundle
from models.policies.channels import PrototypeChannel
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy
from models.training import checkpoint
from models.training.checks import Checked, calibrate, check
from models.training.config import Phase, Recipe
from models.training.curriculum import Progress, between, same_regime
from models.training.enforcer import Enforcer
from models.training.held import ANCESTOR, RunError, ancestor
from models.training.overrides import Overrides
from models.training.quantise import head_start, kmeans, revived
from models.training.reinforce import Learner, gradient_loss, shares
from models.training.situations import beginning, generator
from models.training.unroll import Beginning, Manner, Unrolled, unroll

LOG = "log.csv"
COLUMNS = (
    "phase", "update", "total", "env_steps", "seconds", "lr", "loss", "parts",
    "success", "human", "arrived", "steps", "message_rate", "human_rate", "tokens_used", "reward", "score", "best",
)  # fmt: skip
CODEBOOK_BATCHES = 4  # unrolls from which the codebook is built: some 10,000 messages


class TrainingError(Exception):
    """A run cannot go on. One line: what happened, and where the last good weights are."""


class Trainer:
    """One run: weights, optimiser, place in the recipe, best so far."""

    def __init__(self, recipe: Recipe, folder: Path, bundles: Path) -> None:
        self.recipe, self.folder, self.bundles = recipe, folder, bundles
        self.env = registry.make(recipe.task)
        self.at = Progress()
        self.finished = False
        self.enforcer: Enforcer | None = None
        self.best: dict[str, Tensor] = {}
        self.best_score = float("-inf")
        self.status = recipe.name
        self._codebook_due = False  # inherited weights without one: the first discrete phase builds it
        self._uses = torch.zeros(recipe.model.tokens, dtype=torch.int64)
        self._seconds = 0.0
        self._losses: dict[str, float] = {}

    @property
    def phase(self) -> Phase:
        return self.recipe.phase[self.at.phase]

    def open(self, resume: bool) -> None:
        """Start afresh, or from the folder's checkpoint."""
        held = (self.folder / checkpoint.FILE).exists()
        if held and not resume:
            raise TrainingError(f"{self.folder}: holds a run already; resume it or choose another folder")
        self.folder.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(self.recipe.seed)
        sizes = self.recipe.model.model_dump()
        net = RecurrentNet(
            Architecture(observation_size=self.env.observation_size, actions=self.env.actions, **sizes)
        )
        self.learner = Learner(self.env, net, self.recipe.decoder)
        if held:
            self._restore()
            return
        if self.recipe.init_from is not None:
            self._inherit(self.recipe.init_from)
        self._enter()
        with (self.folder / LOG).open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(COLUMNS)

    def _inherit(self, name: str) -> None:
        """Take the weights of a bundle or run; channel and gate may begin anew, such a gate open."""
        weights = self._ancestor(name)
        own = self.learner.net.state_dict()
        odd = [key for key, value in own.items() if key in weights and weights[key].shape != value.shape]
        anew = {key for key in own if key.startswith(("channel.", "gate."))}
        if odd or set(weights) - set(own) or set(own) - set(weights) - anew:
            raise TrainingError(f"init_from {name}: its sizes are not those of [model]")
        self.learner.net.load_state_dict(own | weights)
        self._codebook_due = "channel.codebook" in set(own) - set(weights)
        if self.learner.net.gate is not None and not any(key.startswith("gate.") for key in weights):
            torch.nn.init.zeros_(self.learner.net.gate[-1].weight)
            torch.nn.init.constant_(self.learner.net.gate[-1].bias, 1.0)

    def _ancestor(self, name: str) -> dict[str, Tensor]:
        """Weights of a bundle, or of ``run:recipe``, that recipe's run with the same seed."""
        try:
            if name.startswith(ANCESTOR):
                return ancestor(self.folder, name, self.recipe.seed).policy.weights()
            source = bundle.load(self.bundles / name).policy
        except (bundle.BundleError, RunError, checkpoint.CheckpointError) as error:
            raise TrainingError(f"init_from {name}: {error}; train that recipe first") from None
        assert isinstance(source, RecurrentPolicy)
        return source.weights()

    def _enter(self) -> None:
        """Begin the phase at hand: codebook, optimiser, controller."""
        phase = self.phase
        before = self.recipe.phase[self.at.phase - 1] if self.at.phase else None
        if before is not None and not same_regime(self.recipe, self.at.phase - 1, self.at.phase):
            self.best, self.best_score = {}, float("-inf")
        if phase.discrete and (self._codebook_due if before is None else not before.discrete):
            self._build_codebook()
        self.optimiser = torch.optim.Adam(self.learner.parameters(), lr=phase.lr)
        budget = phase.budget if phase.gate == "enforced" else None
        self.enforcer = None if budget is None else Enforcer(budget)
        self._uses.zero_()

    @torch.no_grad()
    def _build_codebook(self) -> None:
        channel = self.learner.net.channel
        if not isinstance(channel, PrototypeChannel):
            return
        continuous = self.phase.model_copy(update={"discrete": False})
        updates = range(self.at.total, self.at.total + CODEBOOK_BATCHES)
        raw = [one.raw[_uttered(one)] for update in updates for one, _ in self._windows(continuous, update)]
        draws = generator(self.recipe.seed, self.at.total)
        channel.codebook.copy_(kmeans(torch.cat(raw), self.recipe.model.tokens, draws))

    def advance(self) -> None:
        """One update, and whatever is due after it: check, revival, next phase, end."""
        begun = time.perf_counter()
        phase = self.phase
        entropy = between(phase.entropy, phase.entropy_end, self.at, phase)
        steps = 0
        for seen, rule in self._windows(phase, self.at.total):
            loss = gradient_loss(self.env, self.learner, seen, phase, entropy, self.enforcer, rule)
            if not torch.isfinite(loss.total):
                raise TrainingError(
                    f"loss is {loss.total.item()} in phase {phase.name!r}; {self._last_good()}"
                )
            self._descend(loss.total)
            self._losses = loss.parts
            if self.enforcer is not None:
                self.enforcer = self.enforcer.after(shares(seen))
            self._count(seen)
            steps += int((~np.stack([self.env.done(s) for s in seen.states[:-1]])).sum())
        self._revive(seen)
        self.at = self.at.updated(steps)
        self._seconds += time.perf_counter() - begun
        if self.at.update % self.recipe.check.every == 0 or self.at.ends(phase):
            self._check()

    def _last_good(self) -> str:
        path = self.folder / checkpoint.FILE
        return (
            f"last good checkpoint: {path}" if path.exists() else "no checkpoint yet; lower the learning rate"
        )

    def _descend(self, loss: Tensor) -> None:
        phase = self.phase
        for group in self.optimiser.param_groups:
            group["lr"] = between(phase.lr, phase.lr_end, self.at, phase)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        for part in self.learner.children():  # apart: large value errors must not shrink the policy's steps
            torch.nn.utils.clip_grad_norm_(part.parameters(), phase.clip)
        self.optimiser.step()

    def _windows(self, phase: Phase, update: int) -> Iterator[tuple[Unrolled, NDArray[np.int64] | None]]:
        """Play the episodes of one update, window by window, with the rule's actions (M,) if wanted."""
        recipe, steps_max = self.recipe, 1 if phase.first_step else self.env.steps_max
        manner = Manner(phase.discrete, phase.sampled, phase.explore, phase.gate == "open")
        draws = generator(recipe.seed, update)
        begin = beginning(
            self.env, self.learner.net, recipe.start, manner, phase.episodes, recipe.seed, update, draws
        )
        override = Overrides(self.env, recipe, phase, self.at, update)
        for first in range(0, steps_max, phase.window or steps_max):
            steps = range(first, min(first + (phase.window or steps_max), steps_max))
            seen = unroll(self.env, self.learner.net, begin, manner, draws, override.use, steps)
            yield seen, override.rows(seen)
            begin = Beginning(seen.states[-1], seen.memory)

    def _count(self, seen: Unrolled) -> None:
        """Count the tokens in use."""
        if self.recipe.model.tokens:
            self._uses += torch.bincount(seen.token[_uttered(seen)], minlength=len(self._uses))

    @torch.no_grad()
    def _revive(self, seen: Unrolled) -> None:
        net, channel, phase = self.learner.net, self.learner.net.channel, self.phase
        if net.architecture.tokens == 0 or not phase.discrete or not phase.revive_every:
            return
        early = self.at.update < 0.8 * phase.updates  # what is revived must have time to find its meaning
        if early and (self.at.update + 1) % phase.revive_every == 0:
            if isinstance(channel, PrototypeChannel):
                draws = generator(self.recipe.seed + 1, self.at.total)
                channel.codebook.copy_(revived(channel.codebook, self._uses, seen.raw[_uttered(seen)], draws))
            else:
                last = net.speech[-1]
                assert isinstance(last, torch.nn.Linear)
                last.bias.add_(head_start(self._uses))
            self._uses.zero_()

    def _check(self) -> None:
        """Evaluate, keep the best, log, move on to the next phase if it is time, and write the checkpoint."""
        phase = self.phase
        net = self._judged()
        checked = check(self.env, net, phase, self.recipe.check)
        better = checked.score > self.best_score
        if better:
            self.best_score = checked.score
            self.best = {name: value.clone() for name, value in net.state_dict().items()}
        self._log(checked, better)
        self.status = (
            f"{self.recipe.name} {phase.name}: success {checked.success:.3f}, score {checked.score:.3f}"
        )
        self.at = self.at.checked(phase, checked.success)
        if self.at.ends(phase):
            self.learner.net.load_state_dict(self.best)
            if self.at.phase + 1 == len(self.recipe.phase):
                self.finished = True
            else:
                self.at = self.at.next_phase()
                self._enter()
        self._save()

    def _judged(self) -> RecurrentNet:
        """The policy as people would meet it; drawn gates held at a budget get their greedy threshold."""
        phase = self.phase
        if phase.gate not in ("budget", "enforced") or phase.budget is None or not phase.sampled:
            return self.learner.net
        net = copy.deepcopy(self.learner.net)
        calibrate(self.env, net, phase.budget, self.recipe.check)
        return net

    def _log(self, checked: Checked, better: bool) -> None:
        phase, at = self.phase, self.at
        parts = " ".join(f"{name}={value:.4f}" for name, value in self._losses.items())
        lr = between(phase.lr, phase.lr_end, at, phase)
        numbers = [f"{value:.4f}" if isinstance(value, float) else value for value in checked]
        row = [phase.name, at.update, at.total, at.steps, f"{self._seconds:.1f}", f"{lr:.2e}",
               f"{sum(self._losses.values()):.4f}", parts, *numbers, int(better)]  # fmt: skip
        with (self.folder / LOG).open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(row)

    def _save(self) -> None:
        tensors = {f"learner.{name}": value for name, value in self.learner.state_dict().items()}
        tensors |= {f"best.{name}": value for name, value in self.best.items()}
        tensors |= checkpoint.optimiser_tensors(self.optimiser)
        tensors["uses"] = self._uses
        enforcer = None if self.enforcer is None else [self.enforcer.previous, self.enforcer.total]
        facts = {
            "recipe": fingerprint(self.recipe), "at": self.at.to_dict(), "finished": self.finished,
            "best_score": self.best_score if self.best else None, "enforcer": enforcer, "seconds":
            self._seconds, "log_bytes": (self.folder / LOG).stat().st_size,
        }  # fmt: skip
        checkpoint.write(self.folder, tensors, facts)

    def _restore(self) -> None:
        held = checkpoint.read(self.folder)
        if held.facts["recipe"] != fingerprint(self.recipe):
            raise TrainingError(f"{self.folder}: belongs to another recipe; choose another folder")
        self.at = Progress.from_dict(held.facts["at"])
        self._enter_again()
        self.learner.load_state_dict(checkpoint.part_of(held.tensors, "learner."))
        self.best = checkpoint.part_of(held.tensors, "best.")
        score = held.facts["best_score"]
        self.best_score = float("-inf") if score is None else score
        checkpoint.restore_optimiser(self.optimiser, held.tensors)
        self._uses = held.tensors["uses"]
        if held.facts["enforcer"] is not None and self.enforcer is not None:
            previous, total = held.facts["enforcer"]
            self.enforcer = replace(self.enforcer, previous=previous, total=total)
        self.finished, self._seconds = held.facts["finished"], held.facts["seconds"]
        with (self.folder / LOG).open("r+b") as file:
            file.truncate(held.facts["log_bytes"])

    def _enter_again(self) -> None:
        self.optimiser = torch.optim.Adam(self.learner.parameters(), lr=self.phase.lr)
        budget = self.phase.budget if self.phase.gate == "enforced" else None
        self.enforcer = None if budget is None else Enforcer(budget)

    def best_policy(self) -> RecurrentPolicy:
        """The best of the last regime."""
        self.learner.net.load_state_dict(self.best)
        return RecurrentPolicy(self.learner.net)


def _uttered(seen: Unrolled) -> Tensor:
    """Rows whose message can be heard."""
    return torch.from_numpy(np.flatnonzero(seen.uttered))


def fingerprint(recipe: Recipe) -> str:
    """sha256 of a recipe's content."""
    return hashlib.sha256(json.dumps(recipe.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()
