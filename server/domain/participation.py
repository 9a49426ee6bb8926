"""A session as a plan: its pages and its rounds follow from the study, the arm and the participant's seed.

Pages: `instructions:<block>`, then `play:<block>` (practice rounds, then main rounds), for each block; then
`complete`. A round is counted over the whole session from 1, practice included. All arms play the same
situations; the order is drawn per participant.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from models import rng
from server.domain.spec import Phase
from server.domain.study import Role, StudyDefinition

# Streams of word(seed, stream, step, index). Seed of a study's situations: step = situation, index = role.
SITUATIONS, PRACTICE_SITUATIONS = 64, 65
# Seed of a participant: step = role for the order of its rounds.
ROUND_ORDER, SIGN_PLACES, SIGN_NUMBERS = 66, 67, 68
ROLES: tuple[Role, ...] = ("parent", "child", "driver")
SEED_SHIFT = 11  # 53 bits: exact in JavaScript and in spreadsheets

PageKind = Literal["instructions", "play", "complete"]
COMPLETE = "complete"


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

    def page_after(self, page: str) -> str:
        return self.pages[min(self.pages.index(page) + 1, len(self.pages) - 1)]


def plan(study: StudyDefinition, role_order: str, seed: int) -> Plan:
    """The session of a participant with this seed."""
    roles = roles_of(role_order)
    rounds: list[Round] = []
    for block, role in enumerate(roles, start=1):
        rounds += block_rounds(study, block, role, seed, first=len(rounds) + 1)
    pages = [f"{kind}:{block}" for block in range(1, len(roles) + 1) for kind in ("instructions", "play")]
    return Plan(tuple(rounds), (*pages, COMPLETE), len(roles))


def roles_of(role_order: str) -> tuple[Role, ...]:
    """Roles in the order of their blocks; `parent-child` is parent first."""
    return tuple(role for name in role_order.split("-") for role in ROLES if role == name)


def page_kind(page: str) -> tuple[PageKind, int]:
    """Kind and block of a page; `complete` has block 0."""
    kind, _, block = page.partition(":")
    if kind == "instructions":
        return "instructions", int(block)
    return ("play", int(block)) if kind == "play" else ("complete", 0)


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
    """Whether an unfinished participant no longer holds a place: unseen since before the lease began."""
    return status != "finished" and last_seen_utc < lease_began_utc
