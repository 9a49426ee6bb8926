"""The flow of a study as a CONSORT diagram draws it: how many came to each stage, and why data are left out.

Everybody who consented is either analysed or has exactly one reason why not. How many saw the link and did
nothing is known to nobody.
"""

from collections.abc import Mapping
from enum import StrEnum

ABANDONED = "abandoned"
"""Standing of who came to no end and was not seen for longer than the lease."""
ERASED = "erased"
"""Standing of who had consented and was erased for good: only that they were there is known."""


class Stage(StrEnum):
    INVITED = "invited"
    DECLINED = "declined"
    SCREENED_OUT = "screened_out"
    """The device did not fit, before consent."""
    CONSENTED = "consented"
    QUIZ_FAILED = "quiz_failed"
    WITHDRAWN = "withdrawn"
    TIMED_OUT = "timed_out"
    RETURNED = "returned"
    REJECTED = "rejected"
    ABANDONED = "abandoned"
    IN_PROGRESS = "in_progress"
    ERASED = "erased"
    FINISHED = "finished"
    """Went through everything, attentive or not."""
    ATTENTION_FAILED = "attention_failed"
    ANALYSED = "analysed"


STANDINGS: Mapping[str, Stage] = {
    "screened_out": Stage.QUIZ_FAILED,
    "withdrawn": Stage.WITHDRAWN,
    "timed_out": Stage.TIMED_OUT,
    "returned": Stage.RETURNED,
    "rejected": Stage.REJECTED,
    ABANDONED: Stage.ABANDONED,
    "active": Stage.IN_PROGRESS,
    ERASED: Stage.ERASED,
    "failed": Stage.ATTENTION_FAILED,
    "finished": Stage.ANALYSED,
}
"""Where somebody who consented stands, by stored status; `abandoned` is told from `active` by the lease."""

REASONS: Mapping[Stage, str] = {
    Stage.QUIZ_FAILED: "quiz",
    Stage.WITHDRAWN: "withdrawn",
    Stage.TIMED_OUT: "timed_out",
    Stage.RETURNED: "returned",
    Stage.REJECTED: "rejected",
    Stage.ABANDONED: "incomplete",
    Stage.IN_PROGRESS: "incomplete",
    Stage.ERASED: "erased",
    Stage.ATTENTION_FAILED: "attention",
}
"""Why somebody who stands there is not analysed."""

BEFORE_CONSENT = (Stage.INVITED, Stage.DECLINED, Stage.SCREENED_OUT)
LOST = tuple(stage for stage in REASONS if stage is not Stage.ATTENTION_FAILED)
"""Between consent and the last page."""


def exclusion_reason(standing: str) -> str | None:
    """Why the data of somebody with this standing are not analysed; None: they are."""
    return REASONS.get(STANDINGS[standing])


def counted(people: Mapping[str, int], refused: Mapping[str, int]) -> dict[Stage, int | None]:
    """How many came to each stage.

    Args:
        people: those who consented, by standing.
        refused: those who never entered, by `declined` and `screened_out`.

    Returns:
        Every stage, in the order of the diagram; None: unknown.
    """
    found: dict[Stage, int | None] = {
        Stage.INVITED: None,
        Stage.DECLINED: refused.get("declined", 0),
        Stage.SCREENED_OUT: refused.get("screened_out", 0),
    }
    return found | after_consent(people)


def after_consent(people: Mapping[str, int]) -> dict[Stage, int | None]:
    """The stages from consent on: of a whole study, or of one arm."""
    at = dict.fromkeys(STANDINGS.values(), 0)
    for standing, number in people.items():
        at[STANDINGS[standing]] += number
    at[Stage.CONSENTED] = sum(at.values())
    at[Stage.FINISHED] = at[Stage.ATTENTION_FAILED] + at[Stage.ANALYSED]
    return {stage: at[stage] for stage in Stage if stage not in BEFORE_CONSENT}
