"""The token panel of Parent & Lost Child: signs on the plane of the prototypes.

A study's panel bundle gives the positions, in every arm. In the prototype arm token i stands at position i;
in the one-hot and the shuffled arm at position π(i). Numbers go to positions by a second permutation, in all
arms. Both are drawn once, at enrolment, and stored with the participant.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from server.domain.plan import SIGN_NUMBERS, SIGN_PLACES, permutation
from server.domain.spec import Panel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from models.policies.bundle import PolicyBundle
    from server.domain.study import Communication

DIGITS = 4  # of a position in the unit square: 1/10,000 of the plane is less than a pixel


def token_places(communication: Communication, seed: int, tokens: int) -> list[int]:
    """The position of each token: its own in the prototype arm, else permuted."""
    if communication == "prototype":
        return list(range(tokens))
    return permutation(seed, SIGN_PLACES, 0, tokens)


def position_numbers(seed: int, tokens: int) -> list[int]:
    """The number on screen, from 1, at each position."""
    return [place + 1 for place in permutation(seed, SIGN_NUMBERS, 0, tokens)]


def panel(bundle: PolicyBundle, places: Sequence[int], numbers: Sequence[int]) -> Panel:
    """The panel of a participant, with the positions of the panel bundle."""
    return Panel(
        bundle=bundle.name,
        sha256=bundle.sha256,
        positions=tuple(
            (round(float(x), DIGITS), round(float(y), DIGITS)) for x, y in bundle.lexicon.positions
        ),
        position_of_token=tuple(places),
        number_at_position=tuple(numbers),
    )
