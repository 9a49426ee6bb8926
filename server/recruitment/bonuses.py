"""Bonuses of one call, by the names of their payments."""

from collections.abc import Sequence

from server.recruitment.recruiter import Bonus, RecruiterError


def by_request(bonuses: Sequence[Bonus]) -> dict[str, Bonus]:
    """Each request once. Two bonuses under one name, or an amount that is none, are refused."""
    wanted: dict[str, Bonus] = {}
    for bonus in bonuses:
        if bonus.amount_minor <= 0:
            raise RecruiterError(f"bonus {bonus.request} is {bonus.amount_minor}: an amount is above zero")
        if wanted.setdefault(bonus.request, bonus) != bonus:
            raise RecruiterError(f"two different bonuses are called {bonus.request}")
    return wanted
