"""Money: whole minor units (pence, cents) everywhere; what an end is worth, and how people read it."""

from server.domain.participation import WENT_THROUGH, State
from server.domain.study import Pay

SIGNS = {"GBP": "£", "USD": "$", "EUR": "€"}


def shown(minor: int, currency: str) -> str:
    """As people read it.

    >>> shown(150, "GBP")
    '£1.50'
    """
    return f"{SIGNS.get(currency, currency + ' ')}{minor // 100}.{minor % 100:02d}"


def reward_minor(pay: Pay, status: str) -> int:
    """What somebody of this status is paid for their time, by the study's rule."""
    if status in WENT_THROUGH:
        return pay.reward_minor
    return {State.WITHDRAWN.value: pay.partial_minor, State.SCREENED_OUT.value: pay.screen_out_minor}.get(
        status, 0
    )


def bonus_minor(pay: Pay | None, won: int) -> int:
    """What so many successes are worth, by the study's rule; it is paid to who went through everything."""
    return min(won * pay.bonus_success_minor, pay.bonus_max_minor) if pay else 0
