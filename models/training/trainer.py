"""One training run: weights, optimiser, place in the recipe, the best so far, and all of it on disk.

A run lives in one folder: ``checkpoint.safetensors`` (replaced at each check, and between checks if asked
for) and ``log.csv`` (a line per check). Killed at any moment, it goes on from its last checkpoint and ends
with the same weights, on the same machine.
"""

import copy
import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.envs import registry
from models.policies import bundle
from models.policies.channels import PrototypeChannel
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy
from models.training import checkpoint, log
from models.training.checks import Checked, calibrate, check
from models.training.clock import Clock
from models.training.config import Phase, Recipe
from models.training.curriculum import Progress, between, same_regime
from models.training.enforcer import Enforcer
from models.training.held import ANCESTOR, RunError, ancestor
from models.training.overrides import Overrides
from models.training.packed import unpack
from models.training.quantise import head_start, kmeans, revived
from models.training.reinforce import Learner, gradient_loss, shares
from models.training.situations import beginning, generator
from models.training.unroll import Beginning, Manner, Unrolled, unroll

CPU = torch.device("cpu")
CODEBOOK_BATCHES = 4  # unrolls from which the codebook is built: some 10,000 messages


class TrainingError(Exception):
    """A run cannot go on. One line: what happened, and where the last good weights are."""


class StoppedError(TrainingError):
    """A run that had begun failed: its loss is not a number, or its folder cannot be written."""


@dataclass(slots=True)
class Readings:
    """What a person watches: of the last check (None before the first), and of the last update."""

    success: float | None = None
    message_rate: float | None = None
    """Of greedy gates, which get a threshold that meets a budget: it says nothing about what was learned."""
    drawn_rate: float | None = None
    """Of the last update, of the gates as they were drawn; None if nobody could be heard."""
    score: float | None = None
    entropy: float | None = None
    """Of the actions, in nats."""
    decoder: float | None = None
    """Loss of the decoder without its weight; None if there is none."""


class Trainer:
    """One run: weights, optimiser, place in the recipe, best so far."""

    def __init__(
        self,
        recipe: Recipe,
        folder: Path,
        bundles: Path,
        checkpoint_every: int | None = None,
        device: torch.device = CPU,
    ) -> None:
        """Prepare a run; ``open`` begins it.

        Args:
            recipe: what to do.
            folder: of the run.
            bundles: where ``init_from`` is looked up.
            checkpoint_every: updates between checkpoints, beside those at every check.
            device: where the network is.
        """
        self.recipe, self.folder, self.bundles = recipe, folder, bundles
        self.checkpoint_every, self.device = checkpoint_every, device
        self.env = registry.make(recipe.task)
        self.at = Progress()
        self.finished = self.just_checked = False
        self.enforcer: Enforcer | None = None
        self.best: dict[str, Tensor] = {}
        self.best_score = float("-inf")
        self._codebook_due = False  # inherited weights without one: the first discrete phase builds it
        self.readings = Readings()
        self.clock = Clock()
        self._uses = torch.zeros(recipe.model.tokens, dtype=torch.int64)
        self._losses: dict[str, float] = {}

    @property
    def phase(self) -> Phase:
        return self.recipe.phase[self.at.phase]

    def open(self, resume: bool) -> None:
        """Start afresh, or from the folder's checkpoint."""
        held = checkpoint.exists(self.folder)
        if held and not resume:
            raise TrainingError(f"{self.folder}: holds a run already; resume it or choose another folder")
        with self._writing():
            self.folder.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(self.recipe.seed)
        sizes = self.recipe.model.model_dump()
        net = RecurrentNet(
            Architecture(observation_size=self.env.observation_size, actions=self.env.actions, **sizes)
        )
        self.learner = Learner(self.env, net, self.recipe.decoder).to(self.device)
        if held:
            self._restore()
            return
        if self.recipe.init_from is not None:
            self._inherit(self.recipe.init_from)
        self._enter()
        with self._writing():
            log.start(self.folder)

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
        gate = self.learner.net.gate
        if gate is not None and not any(key.startswith("gate.") for key in weights):
            last = gate[-1]
            assert isinstance(last, torch.nn.Linear)
            torch.nn.init.zeros_(last.weight)
            torch.nn.init.constant_(last.bias, 1.0)

    def _ancestor(self, name: str) -> dict[str, Tensor]:
        """Weights of a bundle, or of ``run:recipe``, that recipe's run with the same seed."""
        try:
            if name.startswith(ANCESTOR):
                return ancestor(self.folder, name, self.recipe.seed).policy.weights()
            source = bundle.load(self.bundles / name).policy
        except (bundle.BundleError, RunError, checkpoint.CheckpointError) as error:
            raise TrainingError(f"init_from {name}: {error}; train that recipe first") from None
        if not isinstance(source, RecurrentPolicy):
            raise TrainingError(f"init_from {name}: another architecture than the one that is trained here")
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
        raw = [
            one.raw[_uttered(one)].cpu() for update in updates for one, _ in self._windows(continuous, update)
        ]
        draws = generator(self.recipe.seed, self.at.total)
        channel.codebook.copy_(kmeans(torch.cat(raw), self.recipe.model.tokens, draws))

    def advance(self) -> None:
        """One update, and whatever is due after it: check, revival, next phase, end, checkpoint."""
        self.clock.begin()
        self.just_checked = False
        phase = self.phase
        entropy = between(phase.entropy, phase.entropy_end, self.at, phase)
        steps = sent = heard = 0
        for seen, rule in self._windows(phase, self.at.total):
            loss = gradient_loss(self.env, self.learner, seen, phase, entropy, self.enforcer, rule)
            self._descend(loss.total)
            self._losses = loss.parts
            if self.enforcer is not None:
                self.enforcer = self.enforcer.after(shares(seen))
            self._count(seen)
            sent += int(seen.gate.detach()[_uttered(seen).to(self.device)].sum())
            heard += int(seen.uttered.sum())
            steps += int((~np.stack([self.env.done(s) for s in seen.states[:-1]])).sum())
        self._read(seen)
        self.readings.drawn_rate = sent / heard if heard else None
        self._revive(seen)
        self.at = self.at.updated(steps)
        if self.at.update % self.recipe.check.every == 0 or self.at.ends(phase):
            self._check()
        elif self.checkpoint_every and self.at.total % self.checkpoint_every == 0:
            self._save()
        self.clock.lap()

    def _read(self, seen: Unrolled) -> None:
        """Entropy and decoder of the update's last window."""
        logits = seen.logits.detach().log_softmax(1)
        self.readings.entropy = float(-(logits.exp() * logits).sum(1).mean())
        weighted = self._losses.get("decoder")
        self.readings.decoder = None if weighted is None else weighted / self.phase.decoder_weight

    def _last_good(self) -> str:
        path = self.folder / checkpoint.FILE
        return (
            f"last good checkpoint: {path}" if path.exists() else "no checkpoint yet; lower the learning rate"
        )

    def _require_finite(self, number: Tensor, what: str) -> None:
        if not torch.isfinite(number):
            raise StoppedError(
                f"{what} is {number.item()} at update {self.at.total + 1:,} "
                f"(phase {self.phase.name!r}); {self._last_good()}"
            )

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Turn a full or broken disk into one line."""
        try:
            yield
        except OSError as error:
            raise StoppedError(
                f"{self.folder}: cannot be written ({error.strerror or error}); {self._last_good()}"
            ) from None

    def _descend(self, loss: Tensor) -> None:
        """One step of the optimiser; weights are never touched by what is not a number."""
        phase = self.phase
        self._require_finite(loss, "loss")
        for group in self.optimiser.param_groups:
            group["lr"] = between(phase.lr, phase.lr_end, self.at, phase)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        for part in self.learner.children():  # apart: large value errors must not shrink the policy's steps
            norm = torch.nn.utils.clip_grad_norm_(part.parameters(), phase.clip)
            self._require_finite(norm, "gradient")
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
            self._uses += torch.bincount(seen.token[_uttered(seen)].cpu(), minlength=len(self._uses))

    @torch.no_grad()
    def _revive(self, seen: Unrolled) -> None:
        net, channel, phase = self.learner.net, self.learner.net.channel, self.phase
        if net.architecture.tokens == 0 or not phase.discrete or not phase.revive_every:
            return
        early = self.at.update < 0.8 * phase.updates  # what is revived must have time to find its meaning
        if early and (self.at.update + 1) % phase.revive_every == 0:
            if isinstance(channel, PrototypeChannel):
                draws = generator(self.recipe.seed + 1, self.at.total)
                raw = seen.raw[_uttered(seen)].cpu()
                channel.codebook.copy_(revived(channel.codebook.cpu(), self._uses, raw, draws))
            else:
                last = net.speech[-1]
                assert isinstance(last, torch.nn.Linear)
                last.bias.add_(head_start(self._uses).to(self.device))
            self._uses.zero_()

    def _check(self) -> None:
        """Evaluate, keep the best, log, move on to the next phase if it is time, and write the checkpoint."""
        phase = self.phase
        net = self._judged()
        drawn_rate = self.readings.drawn_rate if _draws_gates(phase) else None
        checked = check(self.env, net, phase, self.recipe.check, drawn_rate)
        better = checked.score > self.best_score
        if better:
            self.best_score = checked.score
            self.best = {name: value.clone() for name, value in net.state_dict().items()}
        for name in ("success", "message_rate", "score"):
            setattr(self.readings, name, getattr(checked, name))
        self._log(checked, better)
        self.just_checked = True
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
        """The policy as people would meet it: greedy gates, with a threshold if drawn ones keep a budget."""
        phase, net = self.phase, self.learner.net
        drawn = _draws_gates(phase)
        if self.device != CPU or drawn:
            net = copy.deepcopy(net).to(CPU)
        if drawn and phase.budget is not None:
            calibrate(self.env, net, phase.budget, self.recipe.check)
        return net

    def _log(self, checked: Checked, better: bool) -> None:
        self.clock.lap()
        phase, at, now = self.phase, self.at, self.readings
        parts = " ".join(f"{name}={value:.4f}" for name, value in self._losses.items())
        lr = between(phase.lr, phase.lr_end, at, phase)
        row = (phase.name, at.update, at.total, at.steps, f"{self.clock.seconds:.1f}",
               f"{self.clock.cpu_s:.1f}", f"{lr:.2e}", sum(self._losses.values()), parts, now.entropy,
               now.decoder, now.drawn_rate, *checked, int(better))  # fmt: skip
        with self._writing():
            log.add(self.folder, row)

    def _save(self) -> None:
        self.clock.lap()
        tensors = {f"learner.{name}": value for name, value in self.learner.state_dict().items()}
        tensors |= {f"best.{name}": value for name, value in self.best.items()}
        tensors |= checkpoint.optimiser_tensors(self.optimiser)
        tensors["uses"] = self._uses
        enforcer = None if self.enforcer is None else [self.enforcer.previous, self.enforcer.total]
        facts = {
            "recipe": fingerprint(self.recipe), "at": self.at.to_dict(), "finished": self.finished,
            "best_score": self.best_score if self.best else None, "enforcer": enforcer,
            "seconds": self.clock.seconds, "cpu_s": self.clock.cpu_s,
        }  # fmt: skip
        with self._writing():
            checkpoint.write(self.folder, tensors, facts | {"log_bytes": log.size(self.folder)})

    def _restore(self) -> None:
        held = self._held()
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
        self.finished = held.facts["finished"]
        seconds = held.facts["seconds"]
        self.clock = Clock(seconds, held.facts.get("cpu_s", seconds))  # version 0.1 kept one of them

    def _held(self) -> checkpoint.Checkpoint:
        """The checkpoint, or what was packed of one; the log ends where it does."""
        if (self.folder / checkpoint.FILE).exists():
            held = checkpoint.read(self.folder)
            log.cut(self.folder, held.facts["log_bytes"])
            return held
        packed = unpack(self.folder)
        with self._writing():
            (self.folder / log.FILE).write_bytes(packed.log)
        return packed.checkpoint

    def _enter_again(self) -> None:
        self.optimiser = torch.optim.Adam(self.learner.parameters(), lr=self.phase.lr)
        budget = self.phase.budget if self.phase.gate == "enforced" else None
        self.enforcer = None if budget is None else Enforcer(budget)

    def best_policy(self) -> RecurrentPolicy:
        """The best of the last regime."""
        self.learner.net.load_state_dict(self.best)
        return RecurrentPolicy(self.learner.net.to(CPU))


def _draws_gates(phase: Phase) -> bool:
    """Whether gates learn a budget by being drawn, so that greedy ones need a threshold."""
    return phase.gate in ("budget", "enforced") and phase.sampled


def _uttered(seen: Unrolled) -> Tensor:
    """Rows whose message can be heard."""
    return torch.from_numpy(np.flatnonzero(seen.uttered))


def fingerprint(recipe: Recipe) -> str:
    """sha256 of a recipe's content."""
    said = recipe.model_dump(mode="json", exclude_defaults=True)  # new fields change no old recipe
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()
