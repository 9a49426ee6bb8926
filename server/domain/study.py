"""What a study is: its definition as a frozen value, with one message per wrong field.

It is read from TOML, JSON or a form. A launched version is this value in canonical JSON and its sha256.
Whether the named bundles exist and fit is judged against `Offer`s, plain facts about the loaded bundles.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from models.envs import registry
from server.domain import canonical
from server.domain.errors import DefinitionError

Task = Literal["parent_child", "traffic_junction"]
Communication = Literal["prototype", "one-hot", "shuffled"]
Role = Literal["parent", "child", "driver"]
Environment = Literal[
    "parent_child", "traffic_junction/easy", "traffic_junction/medium", "traffic_junction/hard"
]

SIGNS_MAX = 9  # digits on a keyboard; the token palette has nine distinguishable signs (mockups/NOTES.md)
COMMUNICATIONS: dict[Task, frozenset[str]] = {
    "parent_child": frozenset(get_args(Communication)),
    "traffic_junction": frozenset({"prototype"}),
}
ROLE_ORDERS: dict[Task, tuple[str, ...]] = {
    "parent_child": ("parent-child", "child-parent"),
    "traffic_junction": ("driver",),
}

Slug = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,47}$")]
Line = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=200)]
Paragraph = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=4_000)]
Code = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,64}$")]


class Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Arm(Part):
    name: Slug
    communication: Communication = "prototype"
    bundle: Line
    """Name of a released agent, `<task>/<name>`."""
    budget: float = Field(default=1.0, gt=0, le=1)
    """Share of steps at which an agent may speak; must be what the bundle was trained for."""
    overlay: bool = True
    """Whether the ghost shows what it makes of the messages."""
    places: int = Field(ge=1, le=100_000)


class Texts(Part):
    welcome: Paragraph
    consent: tuple[Paragraph, ...] = Field(min_length=1, max_length=40)
    consent_version: Line
    agree: Line
    instructions: tuple[Paragraph, ...] = Field(default=(), max_length=10)
    """Shown above the built-in instructions of every block; usually empty."""
    declined: Paragraph
    complete: Paragraph


class StudyDefinition(Part):
    slug: Slug
    title: Line
    task: Task
    environment: Environment
    panel_bundle: Line | None = None
    """Parent & Lost Child: the prototype bundle whose PCA positions serve every arm."""
    arms: tuple[Arm, ...] = Field(min_length=1, max_length=12)
    trials_per_block: int = Field(default=20, ge=1, le=200)
    practice_rounds: int = Field(default=1, ge=0, le=5)
    step_limit: int = Field(ge=1, le=200)
    """The participant's own decisions (driver) or the parent's steps."""
    arrival: float = Field(default=0.05, ge=0, le=1)
    """Traffic Junction: chance of a new car per entrance and step once the participant drives."""
    child_sees_parent: bool = True
    texts: Texts
    contact: Line
    duration_min: int = Field(ge=1, le=240)
    reward_text: Line
    completion_code: Code
    completion_url: Annotated[str, StringConstraints(pattern=r"^(https://\S+)?$", max_length=500)] = ""
    """Where the participant returns to, `{code}` in the place of the code; empty: no link."""
    lease_min: int = Field(default=60, ge=5, le=1_440)
    """A participant who has not been seen for longer no longer holds a place."""
    situation_seed: int = Field(ge=0, lt=2**53)
    """Root of the situations, which are the same for every arm."""

    @property
    def role_orders(self) -> tuple[str, ...]:
        return ROLE_ORDERS[self.task]

    @property
    def places(self) -> int:
        return sum(arm.places for arm in self.arms)

    @property
    def agents(self) -> frozenset[str]:
        """Every bundle that somebody in this study may need."""
        named = {arm.bundle for arm in self.arms}
        return frozenset(named | {self.panel_bundle} if self.panel_bundle else named)

    @cached_property
    def canonical(self) -> str:
        return canonical.dumps(self.model_dump(mode="json"))

    @cached_property
    def sha256(self) -> str:
        return canonical.sha256(self.canonical)

    @cached_property
    def consent_sha256(self) -> str:
        return canonical.sha256(canonical.dumps([self.texts.agree, *self.texts.consent]))

    def arm(self, name: str) -> Arm:
        return next(arm for arm in self.arms if arm.name == name)


@dataclass(frozen=True, slots=True)
class Offer:
    """What a study must know of a loaded bundle. `budget` is 1 for an agent whose gate is always open."""

    name: str
    environment: str
    channel: str
    tokens: int
    budget: float


def read(values: Mapping[str, Any]) -> StudyDefinition:
    """The definition in `values`.

    Raises:
        DefinitionError: with a message for each wrong field, named like `arms.2.budget`.
    """
    try:
        study = StudyDefinition.model_validate(values)
    except ValidationError as error:
        raise DefinitionError({path(e["loc"]): e["msg"] for e in error.errors()}) from error
    if wrong := dict(contradictions(study)):
        raise DefinitionError(wrong)
    return study


def from_json(text: str) -> StudyDefinition:
    """A launched version, as stored. It was checked when it was launched."""
    return StudyDefinition.model_validate_json(text)


def path(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location)


def contradictions(study: StudyDefinition) -> Iterator[tuple[str, str]]:
    """Fields that are wrong only beside others."""
    if study.environment.split("/")[0] != study.task:
        yield "environment", f"{study.environment} is not a world of the task {study.task}"
    if (study.task == "parent_child") != bool(study.panel_bundle):
        yield "panel_bundle", "Parent & Lost Child needs one, Traffic Junction has none"
    if study.step_limit > (steps_max := registry.make(study.environment).steps_max):
        yield "step_limit", f"at most {steps_max} in {study.environment}: an episode ends there"
    if study.completion_url and "{code}" not in study.completion_url:
        yield "completion_url", "must contain {code}"
    seen: set[str] = set()
    for index, arm in enumerate(study.arms):
        if arm.name in seen:
            yield f"arms.{index}.name", f"{arm.name} is the name of another arm"
        seen.add(arm.name)
        if arm.communication not in COMMUNICATIONS[study.task]:
            yield f"arms.{index}.communication", f"{arm.communication} is not used in {study.task}"


def misfits(study: StudyDefinition, offers: Mapping[str, Offer]) -> dict[str, str]:
    """Fields that name a bundle which is not here or does not fit; empty when the study can be launched."""
    wrong = dict(panel_misfits(study, offers))
    for index, arm in enumerate(study.arms):
        wrong.update({f"arms.{index}.{field}": text for field, text in arm_misfits(study, arm, offers)})
    return wrong


def panel_misfits(study: StudyDefinition, offers: Mapping[str, Offer]) -> Iterator[tuple[str, str]]:
    if study.panel_bundle is None:
        return
    offer = offers.get(study.panel_bundle)
    if offer is None:
        yield "panel_bundle", f"no agent {study.panel_bundle} is loaded"
    elif offer.channel != "prototype" or offer.environment != study.environment:
        yield "panel_bundle", "must be a prototype agent of this world: the panel shows its positions"
    elif offer.tokens > SIGNS_MAX:
        yield "panel_bundle", f"offers {offer.tokens} tokens; people get at most {SIGNS_MAX}"


def arm_misfits(study: StudyDefinition, arm: Arm, offers: Mapping[str, Offer]) -> Iterator[tuple[str, str]]:
    offer = offers.get(arm.bundle)
    if offer is None:
        yield "bundle", f"no agent {arm.bundle} is loaded"
        return
    if offer.environment != study.environment:
        yield "bundle", f"was trained in {offer.environment}, not in {study.environment}"
    if abs(offer.budget - arm.budget) > 1e-9:
        yield "budget", f"does not match this agent, which was trained for {offer.budget:g}"
    wanted = "one-hot" if arm.communication == "one-hot" else "prototype"
    if offer.channel != wanted:
        yield "communication", f"needs a {wanted} agent; {arm.bundle} speaks {offer.channel}"
    panel = offers.get(study.panel_bundle or "")
    if panel is not None and panel.tokens != offer.tokens:
        yield "bundle", f"has {offer.tokens} tokens, the panel bundle {panel.tokens}"
