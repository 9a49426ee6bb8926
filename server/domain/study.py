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
from server.domain.questionnaire import AttentionCheck, Questionnaire, QuizQuestion, repeated

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

RESERVED = frozenset({"quiz", "attention", "probe"})
"""Forms that are no questionnaires of a study."""

Slug = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,47}$")]
Line = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=200)]
Paragraph = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=4_000)]
HERE = r"http://(?:localhost|127\.0\.0\.1)(?::\d{1,5})?/"
"""Only this machine may be reached without https: a made-up marketplace lives there."""
Return = Annotated[str, StringConstraints(pattern=rf"^(https://\S+|{HERE}\S*)?$", max_length=500)]
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
    language: Annotated[str, StringConstraints(pattern=r"^[a-z]{2,3}(-[A-Za-z0-9]{2,8})*$")] = "en"
    """BCP 47 language of these texts: what screen readers pronounce and browsers hyphenate by."""
    direction: Literal["ltr", "rtl"] = "ltr"


class Codes(Part):
    """What a participant hands in at the marketplace, by outcome; an empty one: there is no code for it.

    The code of who finished is the study's `completion_code`.
    """

    screened_out: Code | Literal[""] = ""
    failed: Code | Literal[""] = ""
    """Empty: whoever failed too many attention checks gets the code of who finished."""
    withdrawn: Code | Literal[""] = ""


class Gate(Part):
    """What a browser must be able to do before consent is asked for."""

    width_min: int = Field(default=1024, ge=320, le=4_000)
    """CSS pixels of the window's inside."""
    height_min: int = Field(default=640, ge=240, le=4_000)
    refresh_min_hz: float = Field(default=20, ge=0, le=240)
    """Measured frame rate; 0: any."""
    keyboard: bool = True


class Pay(Part):
    """Money, in minor units (pence, cents) of `currency`. Nothing is paid beyond the two caps."""

    currency: Literal["GBP", "USD", "EUR"] = "GBP"
    reward_minor: int = Field(ge=0, le=100_000)
    """For who went through everything, also with failed attention checks."""
    partial_minor: int = Field(default=0, ge=0, le=100_000)
    """For who withdrew after consent."""
    screen_out_minor: int = Field(default=0, ge=0, le=100_000)
    bonus_success_minor: int = Field(default=0, ge=0, le=100_000)
    """For each main round that was won (found; arrived)."""
    bonus_max_minor: int = Field(default=0, ge=0, le=100_000)
    cap_participant_minor: int = Field(ge=0, le=1_000_000)
    """Most that one person can get, reward and bonus together."""
    cap_study_minor: int = Field(ge=0, le=1_000_000_000)
    """Most that the study can spend on rewards and bonuses."""


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
    completion_url: Return = ""
    """Where the participant returns to, `{code}` in the place of the code; empty: no link."""
    lease_min: int = Field(default=60, ge=5, le=1_440)
    """A participant who has not been seen for longer no longer holds a place."""
    situation_seed: int = Field(ge=0, lt=2**53)
    """Root of the situations, which are the same for every arm."""
    gate: Gate = Gate()
    quiz: tuple[QuizQuestion, ...] = Field(default=(), max_length=40)
    """Comprehension questions after the practice of a role; who fails at the last try is screened out."""
    quiz_tries: int = Field(default=2, ge=1, le=5)
    attention: tuple[AttentionCheck, ...] = Field(default=(), max_length=20)
    attention_failures: int = Field(default=2, ge=1, le=20)
    """So many failed checks, and the data are excluded. Nobody is stopped or rejected for them."""
    questionnaires: tuple[Questionnaire, ...] = Field(default=(), max_length=20)
    token_probe: bool = False
    """Parent & Lost Child: after the rounds, where does each sign point?"""
    codes: Codes = Codes()
    pay: Pay | None = None

    @property
    def returns_here(self) -> bool:
        """Whether the completion link leads to this machine, where a made-up marketplace lives."""
        return self.completion_url.startswith("http://")

    @property
    def role_orders(self) -> tuple[str, ...]:
        return ROLE_ORDERS[self.task]

    @property
    def roles(self) -> frozenset[str]:
        return frozenset(role for order in self.role_orders for role in order.split("-"))

    @property
    def places(self) -> int:
        return sum(arm.places for arm in self.arms)

    @property
    def agents(self) -> frozenset[str]:
        """Every bundle that somebody in this study may need."""
        named = {arm.bundle for arm in self.arms}
        return frozenset(named | {self.panel_bundle} if self.panel_bundle else named)

    @property
    def main_rounds(self) -> int:
        """Main rounds of a session."""
        return self.trials_per_block * len(self.role_orders[0].split("-"))

    def quiz_of(self, role: Role) -> tuple[QuizQuestion, ...]:
        """The questions before the main rounds of a role."""
        return tuple(question for question in self.quiz if question.role in {None, role})

    def questionnaires_at(self, when: Literal["block", "end"]) -> tuple[Questionnaire, ...]:
        return tuple(each for each in self.questionnaires if each.when == when)

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


def answer_key(study: StudyDefinition) -> dict[str, str]:
    """Right answers by `quiz.<key>` and `attention.<key>`, with some number for every number: for robots."""
    right = {f"quiz.{question.key}": str(question.answer) for question in study.quiz}
    right |= {f"attention.{check.key}": str(check.answer) for check in study.attention}
    for asked in study.questionnaires:
        for item in asked.items:
            if item.kind == "number":
                right[f"{asked.key}.{item.key}"] = f"{(item.minimum + item.maximum) // 2:g}"
            elif item.kind == "text":
                right[f"{asked.key}.{item.key}"] = "from a robot"
    return right


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
    yield from question_contradictions(study)
    yield from name_contradictions(study)
    if study.pay is not None:
        yield from money_contradictions(study.pay)
    if study.completion_url and "{code}" not in study.completion_url:
        yield "completion_url", "must contain {code}"
    seen: set[str] = set()
    for index, arm in enumerate(study.arms):
        if arm.name in seen:
            yield f"arms.{index}.name", f"{arm.name} is the name of another arm"
        seen.add(arm.name)
        if arm.communication not in COMMUNICATIONS[study.task]:
            yield f"arms.{index}.communication", f"{arm.communication} is not used in {study.task}"


def question_contradictions(study: StudyDefinition) -> Iterator[tuple[str, str]]:
    """Questions that cannot be asked as they stand."""
    for index, question in enumerate(study.quiz):
        if question.role is not None and question.role not in study.roles:
            yield f"quiz.{index}.role", f"nobody plays the {question.role} in {study.task}"
    for index, check in enumerate(study.attention):
        if check.after > study.main_rounds:
            yield f"attention.{index}.after", f"a session has only {study.main_rounds} main rounds"
    if study.token_probe and study.task != "parent_child":
        yield "token_probe", "only Parent & Lost Child has a panel of signs to ask about"
    if len({check.after for check in study.attention}) < len(study.attention):
        yield "attention", "two checks come after the same round"


def keys_of(study: StudyDefinition) -> Iterator[tuple[str, list[str]]]:
    """Every list whose parts are told apart by a key, with the keys."""
    yield "quiz", [question.key for question in study.quiz]
    yield "attention", [check.key for check in study.attention]
    yield "questionnaires", [each.key for each in study.questionnaires]
    for index, each in enumerate(study.questionnaires):
        yield f"questionnaires.{index}.items", [item.key for item in each.items]


def name_contradictions(study: StudyDefinition) -> Iterator[tuple[str, str]]:
    for name, keys in keys_of(study):
        if (twice := repeated(keys)) is not None:
            yield name, f"{twice} is the key of two"
    for index, each in enumerate(study.questionnaires):
        if each.key in RESERVED:
            yield f"questionnaires.{index}.key", f"{each.key} is a name of hatlab's own; use another"


def money_contradictions(pay: Pay) -> Iterator[tuple[str, str]]:
    """Payments that the caps could never allow."""
    most = pay.reward_minor + pay.bonus_max_minor
    if pay.cap_participant_minor < most:
        yield "pay.cap_participant_minor", f"reward and largest bonus are {most} together"
    if pay.bonus_success_minor and not pay.bonus_max_minor:
        yield "pay.bonus_max_minor", "a bonus for each success needs a maximum"
    if pay.cap_study_minor < pay.cap_participant_minor:
        yield "pay.cap_study_minor", "is less than what one person can get"


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
