"""The probe of the signs: what the page draws, and how good the marks are against P(cell | token)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from server.domain import canonical
from server.services.lab import Lab
from server.services.session import Session
from server.storage.answers import AnswerRow

if TYPE_CHECKING:
    from models.policies.lexicon import Lexicon

PREFIX = "sign_"


class Mark(NamedTuple):
    """One mark, and what the token really says."""

    sign: int
    """Number on the screen."""
    position: int
    """Place on the panel."""
    token: int
    """Index in the bundle's codebook."""
    row: int
    column: int
    probability: float | None
    """P(cell | token) of the marked cell. This and what follows: None where the agent is not loaded."""
    best: float | None
    """The largest P(cell | token)."""
    distance: float | None
    """Expected number of steps from the marked cell to where the token was said."""
    least: float | None
    """The same for the best cell that could be marked."""


def drawing(lab: Lab, session: Session) -> dict[str, Any]:
    """Size of the board, and number and place of every sign, as on the participant's own panel."""
    agent = lab.agent(session.study.panel_bundle or "")
    numbers = canonical.loads(session.participant.number_permutation)
    signs = [
        {"number": number, "position": position, "x": round(float(x), 4), "y": round(float(y), 4)}
        for position, (number, (x, y)) in enumerate(zip(numbers, agent.lexicon.positions, strict=True))
    ]
    return {"size": 9, "signs": signs}


def marks(
    lexicon: "Lexicon | None", places: Sequence[int], numbers: Sequence[int], rows: Sequence[AnswerRow]
) -> list[Mark]:
    """Every mark of a participant, scored against the lexicon of the agent that they played with.

    Args:
        lexicon: of the arm's bundle; None: it is not loaded, and the marks stay without scores.
        places: position of each token, as the participant saw the panel.
        numbers: number at each position, likewise.
        rows: the participant's answers.
    """
    found = []
    for answer in rows:
        if answer.form != "probe:0" or not answer.value:
            continue
        sign = int(answer.item.removeprefix(PREFIX))
        position = numbers.index(sign)
        token = places.index(position)
        row, column = (int(part) for part in answer.value.split(","))
        scores = score(np.asarray(lexicon.probability[token]), row, column) if lexicon else (None,) * 4
        found.append(Mark(sign, position, token, row, column, *scores))
    return found


def score(said: Any, row: int, column: int, size: int = 9) -> tuple[float, float, float, float]:
    """How good one mark is: probability, best, distance and least of a `Mark`.

    `said` is P(cell | token) over size * size cells, row by row.
    """
    cells = np.arange(size * size)
    away = np.abs(cells // size - row) + np.abs(cells % size - column)
    every = np.abs(cells[:, None] // size - cells[None] // size) + np.abs(
        cells[:, None] % size - cells[None] % size
    )
    return (
        float(said[row * size + column]),
        float(said.max()),
        float(said @ away),
        float((every @ said).min()),
    )
