"""A session as a plan: its pages and its rounds follow from the study, the arm and the participant's seed.

Pages of each block: `instructions:<block>`; where the role has a quiz `practice:<block>` and `quiz:<block>`;
`play:<block>` (with the practice rounds first where there is no quiz); where there are questionnaires after
a block `survey:<block>`. Then `probe:0` (what do the signs mean?) and `survey:0`, where the study has them,
and `complete`. A round is counted over the whole session from 1, practice included. All arms play the same
situations; the order is drawn per participant.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from models import rng
from server.domain.spec import Phase
from server.domain.study import Role, StudyDefinition

# Streams of word(seed, stream, step, index). Seed of a study's situations: step = situation, index = role.
SITUATIONS, PRACTICE_SITUATIONS = 64, 65
# Seed of a participant: step = role for the order of its rounds.
ROUND_ORDER, SIGN_PLACES, SIGN_NUMBERS = 66, 67, 68
ROLES: tuple[Role, ...] = ("parent", "child", "driver")
SEED_SHIFT = 11  # 53 bits: exact in JavaScript and in spreadsheets

PageKind = Literal["instructions", "practice", "quiz", "play", "survey", "probe", "complete"]
COMPLETE = "complete"
ROUNDS: frozenset[PageKind] = frozenset({"practice", "play"})
"""Pages on which rounds are played."""


@dataclass(frozen=True, slots=True)
class Round:
    """One trial to come."""

    round: int
    block: int
    phase: Phase
    role: Role
    number: int
    """Within the role and phase, from 1."""
    of: int
    situation: int
    """Which of the study's situations, from 1; practice has its own."""
    seed: int
    last: bool
    """The last round of its block."""


@dataclass(frozen=True, slots=True)
class Plan:
    rounds: tuple[Round, ...]
    pages: tuple[str, ...]
    blocks: int

    def of_block(self, block: int) -> tuple[Round, ...]:
        return tuple(r for r in self.rounds if r.block == block)

    def of_page(self, page: str) -> tuple[Round, ...]:
        """The rounds that are played on a page; none on a page without rounds."""
        kind, block = page_kind(page)
        if kind not in ROUNDS:
            return ()
        apart = f"practice:{block}" in self.pages
        phases = {"practice"} if kind == "practice" else {"main"} if apart else {"practice", "main"}
        return tuple(r for r in self.of_block(block) if r.phase in phases)

    def page_after(self, page: str) -> str:
        return self.pages[min(self.pages.index(page) + 1, len(self.pages) - 1)]


def plan(study: StudyDefinition, role_order: str, seed: int) -> Plan:
    """The session of a participant with this seed."""
    roles = roles_of(role_order)
    rounds: list[Round] = []
    for block, role in enumerate(roles, start=1):
        rounds += block_rounds(study, block, role, seed, first=len(rounds) + 1)
    pages = [page for block, role in enumerate(roles, start=1) for page in block_pages(study, block, role)]
    return Plan(tuple(rounds), (*pages, *last_pages(study), COMPLETE), len(roles))


def block_pages(study: StudyDefinition, block: int, role: Role) -> Iterator[str]:
    yield f"instructions:{block}"
    if study.quiz_of(role):
        if study.practice_rounds:
            yield f"practice:{block}"
        yield f"quiz:{block}"
    yield f"play:{block}"
    if study.questionnaires_at("block"):
        yield f"survey:{block}"


def last_pages(study: StudyDefinition) -> Iterator[str]:
    if study.token_probe:
        yield "probe:0"
    if study.questionnaires_at("end"):
        yield "survey:0"


def forms_of(study: StudyDefinition, planned: Plan) -> list[str]:
    """Names of all forms that somebody who finishes has handed in."""
    names = [page for page in planned.pages if page_kind(page)[0] in {"quiz", "probe"}]
    names += [f"attention:{check.after}" for check in study.attention]
    for page in planned.pages:
        kind, block = page_kind(page)
        if kind == "survey":
            names += [f"{each.key}:{block}" for each in study.questionnaires_at("block" if block else "end")]
    return names


def roles_of(role_order: str) -> tuple[Role, ...]:
    """Roles in the order of their blocks; `parent-child` is parent first."""
    return tuple(role for name in role_order.split("-") for role in ROLES if role == name)


def page_kind(page: str) -> tuple[PageKind, int]:
    """Kind and block of a page; pages after the last block, and whatever is no page, have block 0."""
    name, _, block = page.partition(":")
    kinds: tuple[PageKind, ...] = get_args(PageKind)
    kind: PageKind = next((known for known in kinds if known == name), "complete")
    return kind, int(block) if block.isdecimal() else 0


def block_rounds(study: StudyDefinition, block: int, role: Role, seed: int, first: int) -> list[Round]:
    main = permutation(seed, ROUND_ORDER, ROLES.index(role), study.trials_per_block)
    order: list[tuple[Phase, int]] = [("practice", n) for n in range(study.practice_rounds)]
    order += [("main", n) for n in main]
    numbers = {"practice": study.practice_rounds, "main": study.trials_per_block}
    return [
        Round(
            round=first + index,
            block=block,
            phase=phase,
            role=role,
            number=index + 1 - (study.practice_rounds if phase == "main" else 0),
            of=numbers[phase],
            situation=situation + 1,
            seed=situation_seed(study, phase, role, situation),
            last=index == len(order) - 1,
        )
        for index, (phase, situation) in enumerate(order)
    ]


def situation_seed(study: StudyDefinition, phase: Phase, role: Role, situation: int) -> int:
    """The seed of a world; the same for every participant and arm. `situation` counts from 0 here."""
    stream = SITUATIONS if phase == "main" else PRACTICE_SITUATIONS
    return rng.word(study.situation_seed, stream, situation, ROLES.index(role)) >> SEED_SHIFT


def permutation(seed: int, stream: int, step: int, size: int) -> list[int]:
    """A uniformly drawn order of 0 … size - 1 (Fisher-Yates)."""
    order = list(range(size))
    for last in range(size - 1, 0, -1):
        other = rng.below(rng.word(seed, stream, step, last), last + 1)
        order[last], order[other] = order[other], order[last]
    return order


def missing(plan: Plan, ended: Sequence[tuple[int, str | None]]) -> list[int]:
    """The rounds that have not ended, given (round, outcome) of the stored ones."""
    done = {ordinal for ordinal, outcome in ended if outcome is not None}
    return [r.round for r in plan.rounds if r.round not in done]


def has_left(status: str, last_seen_utc: str, lease_began_utc: str) -> bool:
    """Whether somebody who has not come to an end is past the lease: unseen since before it began."""
    return status == "active" and last_seen_utc < lease_began_utc
