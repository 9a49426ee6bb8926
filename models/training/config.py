"""A recipe: everything needed to train an agent again, read from one TOML file.

    name = "traffic_junction/budget-050"        the bundle it makes
    task = "traffic_junction/medium"
    seed = 1
    [model] [start] [decoder] [check]           sizes, situations, information similarity, held-out checks
    [[phase]] ...                               what is done, in order

Unknown keys, missing keys and values out of range are refused with the name of the field.
"""

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from models.envs import registry
from models.training.imitation import has_rule

Share = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1)]
Weight = Annotated[float, Field(ge=0)]


class RecipeError(Exception):
    """A recipe cannot be followed. One line: file, field and reason."""


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class Model(_Strict):
    """Sizes of the policy; see ``models.policies.recurrent``."""

    hidden: Count = 96
    """Width of encoder and LSTMs."""
    message: Count = 64
    """Floats in a message; with one-hot messages the number of tokens."""
    tokens: Annotated[int, Field(ge=0)] = 0
    """Codebook size; 0 for continuous messages."""
    channel: Literal["none", "continuous", "prototype", "one-hot"] = "continuous"
    """What a message may be."""
    gate: Literal["open", "learned"] = "open"
    """Whether the agents decide when to speak."""


class Start(_Strict):
    """Situations that training draws from."""

    human: Share = 0.0
    """Share of episodes that begin as a human trial does (Traffic Junction only)."""
    arrival: tuple[Share, Share] | None = None
    """Range of the arrival probability, drawn per episode evenly in its logarithm; the world's own if
    absent.
    """
    wobble: Share = 0.0
    """Probability per step that the participant's car brakes against the policy's will, as people do."""


class Decoder(_Strict):
    """Information similarity: an auxiliary reader of what an agent heard, in training only."""

    target: Literal["none", "occupancy", "location", "coordinates"] = "none"
    """occupancy: cells of the other cars now and after gas; location: cell of the child or prey; coordinates:
    its row and column.
    """
    reads: Literal["inbox", "heard"] = "heard"
    """inbox: linear in the mean message; heard: a small network on [second hidden, inbox]."""


class Check(_Strict):
    """Evaluation on held-out situations, which decides what is kept."""

    every: Count = 50
    """Updates between checks."""
    episodes: Count = 400
    """Episodes from ``init``, at the world's own arrival probability."""
    human: Annotated[int, Field(ge=0)] = 0
    """Human trials beside them."""
    human_weight: Share = 0.5
    """Weight of the human trials in the score; the rest is the success from ``init``."""
    score: Literal["success", "reward"] = "success"
    """What is to be maximised; reward is summed over an episode, mean over the seats."""
    steps_weight: Weight = 0.0
    """The score loses this much for a mean episode length of ``steps_max`` (Parent & Lost Child: find
    fast).
    """


class Leave(_Strict):
    """When a phase may end before its updates are used up: a criterion that has held."""

    success: Share = 1.0
    """Least success at a check."""
    checks: Count = 3
    """How often in a row."""


class Phase(_Strict):
    """One stretch of training with fixed rules."""

    name: str
    """For the log."""
    kind: Literal["imitate", "reinforce"] = "reinforce"
    """imitate: labels from a rule, in states that the learner visits; reinforce: policy gradient."""
    updates: Count = 100
    """Gradient steps at most."""
    episodes: Count = 64
    """Episodes per update."""
    window: Annotated[int, Field(ge=0)] = 0
    """Imitation: steps of the world between gradient steps, the memory carried over; 0 is the whole
    episode.
    """
    first_step: bool = False
    """Only the first step of each episode is played: all there is to learn about messages that are held."""
    lr: Annotated[float, Field(gt=0)] = 1e-3
    """Learning rate of Adam at the start."""
    lr_end: Annotated[float, Field(gt=0)] | None = None
    """... and at the end of the phase, linear between; the same if absent."""
    clip: Annotated[float, Field(gt=0)] = 1.0
    """Largest gradient norm."""
    discrete: bool = True
    """False: raw vectors are sent in place of prototypes. The first discrete phase builds the codebook by
    k-means.
    """
    revive_every: Annotated[int, Field(ge=0)] = 25
    """Updates between revivals of unused prototypes; 0 for never."""
    gate: Literal["open", "learned", "rewarded", "enforced", "budget"] = "open"
    """open: always sent; learned: unconstrained; rewarded: penalty on silence; enforced: the Enforcer's
    penalty on the reward; budget: differentiable loss on the mean gate; if gates are drawn, greedy
    ones get a threshold that meets the budget too."""
    budget: Annotated[float, Field(gt=0, le=1)] | None = None
    """Share of messages to be sent (enforced and budget)."""
    gate_weight: Weight = 1.0
    """Weight of the penalty or loss on the gate."""
    gamma: Share = 0.99
    """Discount."""
    lam: Share = 0.95
    """Lambda of generalised advantage estimation; 1 is the plain return minus the baseline."""
    entropy: Weight = 0.01
    """Weight of the action entropy at the start (on normalised advantages)."""
    entropy_end: Weight | None = None
    """... and at the end of the phase, linear between; the same if absent."""
    value_weight: Weight = 0.5
    """Weight of the value baseline's loss."""
    decoder_weight: Weight = 0.0
    """Weight of the information-similarity loss."""
    policy_weight: Weight = 1.0
    """Weight of the policy's loss; 0 trains message and decoder alone."""
    imitation_weight: Weight = 0.0
    """Reinforce only: weight of the imitation loss kept beside the policy gradient."""
    brake_weight: Annotated[float, Field(gt=0)] = 1.0
    """Imitation: weight of steps at which the rule brakes (Traffic Junction)."""
    careful: bool = True
    """Imitation: the rule keeps a free cell ahead, as it must where people drive (Traffic Junction)."""
    rule_share: Share = 0.0
    """Imitation: share of episodes played by the rule at the start of the phase, falling to none at its
    middle.
    """
    explore: Share = 0.0
    """Probability that an action is drawn uniformly instead of from the policy."""
    sampled: bool = True
    """Actions are drawn from the policy; False: greedy (imitation only)."""
    first_collision_only: bool = False
    """Count only a car's first collision in the training reward (Traffic Junction)."""
    shared: Share = 0.0
    """Share of the reward that is the mean over the living agents."""
    leave: Leave | None = None
    """Criterion to leave early."""

    @model_validator(mode="after")
    def _fits(self) -> "Phase":
        if self.gate in ("enforced", "budget") and self.budget is None:
            raise ValueError(f"gate {self.gate!r} needs a budget")
        if self.kind == "imitate" and self.gate in ("rewarded", "enforced"):
            raise ValueError(
                f"gate {self.gate!r} changes the reward, which imitation has none of; use budget"
            )
        if self.kind == "reinforce" and self.window:
            raise ValueError("window is for imitation; the policy gradient needs whole episodes")
        if self.kind == "reinforce" and not self.sampled:
            raise ValueError("the policy gradient needs sampled actions")
        return self


class Recipe(_Strict):
    """A whole recipe file."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+/[a-z0-9-]+$")]
    """Bundle that it makes, ``<task folder>/<name>``."""
    task: str
    """Environment."""
    seed: Annotated[int, Field(ge=0)]
    """All randomness follows from it."""
    budget: Annotated[float, Field(gt=0, le=1)] = 1.0
    """Share of steps at which an agent may speak, for the manifest."""
    warm_start: str | None = None
    """What the weights are started from besides chance, in words, for manifest and card."""
    init_from: str | None = None
    """Whose weights are the start: a bundle, or ``run:easy-fixed-proto`` for the run of that recipe with the
    same seed, in the folder beside this one. A gate that it lacks starts open, a codebook is made by k-means.
    """
    model: Model = Model()
    start: Start = Start()
    decoder: Decoder = Decoder()
    check: Check = Check()
    phase: Annotated[tuple[Phase, ...], Field(min_length=1)]
    """Phases in order."""

    @model_validator(mode="after")
    def _fits(self) -> "Recipe":
        if self.task not in registry.NAMES:
            raise ValueError(f"unknown task {self.task!r}; choose one of {', '.join(registry.NAMES)}")
        traffic = self.task.startswith("traffic_junction")
        if not traffic and (self.start != Start() or self.check.human or self._uses_traffic()):
            raise ValueError(
                f"{self.task} has no traffic: no start, human trials, brake_weight or first_collision_only"
            )
        if not has_rule(self.task) and any(p.kind == "imitate" or p.imitation_weight for p in self.phase):
            raise ValueError(f"{self.task} has no rule to imitate")
        if (self.decoder.target == "occupancy") != traffic and self.decoder.target != "none":
            raise ValueError(f"decoder.target {self.decoder.target!r} does not fit {self.task}")
        if self.model.channel == "one-hot" and self.model.tokens != self.model.message:
            raise ValueError("one-hot messages are as long as the codebook: set model.message = model.tokens")
        if (self.model.channel in ("prototype", "one-hot")) != (self.model.tokens > 0):
            raise ValueError("model.tokens is for prototype and one-hot channels, and needed there")
        if self.model.gate == "open" and any(phase.gate != "open" for phase in self.phase):
            raise ValueError('a phase with a gate that is not "open" needs model.gate = "learned"')
        return self

    def _uses_traffic(self) -> bool:
        return any(p.brake_weight != 1 or p.first_collision_only for p in self.phase)


def parse(raw: dict[str, Any], source: str = "recipe") -> Recipe:
    """Check a recipe that was read from TOML.

    Raises:
        RecipeError: a field is unknown, missing or wrong; the first one is named.
    """
    try:
        return Recipe.model_validate(raw)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or "recipe"
        reason = (
            "unknown key"
            if first["type"] == "extra_forbidden"
            else first["msg"].removeprefix("Value error, ")
        )
        raise RecipeError(f"{source}: {field}: {reason}") from None


def load(path: Path | str) -> Recipe:
    """Read a recipe file.

    Raises:
        RecipeError: it is missing, not TOML, or not a recipe.
    """
    path = Path(path)
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecipeError(f"{path.name}: cannot be read ({error.strerror})") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RecipeError(f"{path.name}: not TOML ({error})") from None
    return parse(raw, path.name)
