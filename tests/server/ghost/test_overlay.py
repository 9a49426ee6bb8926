from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.policies.lexicon import Lexicon
from models.vocabulary import SILENT
from server.domain import trial
from server.domain.view import saw
from server.ghost import overlay, translation
from tests.fakes import fake_lexicon
from tests.server.domain.test_trial import begin

CELLS = 196


def lexicon(*rows: dict[int, float]) -> Lexicon:
    """Token i speaks from these cells; all of them together say something."""
    counts = np.zeros((len(rows), CELLS), np.int64)
    for token, row in enumerate(rows):
        for cell, share in row.items():
            counts[token, cell] = round(share * 10_000)
    return Lexicon.from_counts(counts, np.zeros((len(rows), 2)))


CLEAR = lexicon({20: 1.0}, {20: 0.5, 40: 0.5}, {60: 0.04, 61: 0.96})


def drawn(tokens: list[int], gates: list[bool], own: int = 0) -> list[tuple[int, float]]:
    shown = overlay.triangles(CLEAR, tuple(tokens), tuple(gates), own, 14)
    return [(t.row * 14 + t.col, t.likelihood) for t in shown]


def test_messages_add_up_as_chances_do() -> None:
    assert drawn([1], [True]) == [(20, 0.5), (40, 0.5)]
    assert drawn([1, 1], [True, True]) == [(20, 0.75), (40, 0.75)]


def test_a_closed_gate_and_a_silent_seat_draw_nothing() -> None:
    assert drawn([0, 1, SILENT], [False, False, False]) == []


def test_what_is_unlikely_is_not_drawn() -> None:
    assert drawn([2], [True]) == [(61, 0.96)]


def test_the_own_cell_is_left_out() -> None:
    assert drawn([1], [True], own=40) == [(20, 0.5)]


def test_null_tokens_draw_nothing_but_are_heard() -> None:
    table = fake_lexicon(16, CELLS)
    assert table.null[15]
    assert overlay.triangles(table, (15,), (True,), 0, 14) == ()
    assert overlay.messages_drawn(table, (15, 3, 4), (True, True, False)) == 1


@given(st.lists(st.integers(0, 15), min_size=1, max_size=9), st.randoms())
def test_who_said_what_does_not_show(tokens: list[int], chance: object) -> None:
    table = fake_lexicon(16, CELLS, seed=4)
    shuffled = list(tokens)
    chance.shuffle(shuffled)  # type: ignore[attr-defined]
    gates = (True,) * len(tokens)
    assert overlay.triangles(table, tuple(tokens), gates, 3, 14) == overlay.triangles(
        table, tuple(shuffled), gates, 3, 14
    )


@given(st.lists(st.tuples(st.integers(0, 15), st.booleans()), max_size=9))
def test_triangles_are_ordered_rounded_and_at_least_at_the_threshold(said: list[tuple[int, bool]]) -> None:
    table = fake_lexicon(16, CELLS, seed=4)
    shown = overlay.triangles(table, tuple(t for t, _ in said), tuple(g for _, g in said), 3, 14)
    cells = [(t.row, t.col) for t in shown]
    assert cells == sorted(set(cells))
    assert all(0.05 <= t.likelihood <= 1 and t.likelihood == round(t.likelihood, 3) for t in shown)


def test_practice_shows_the_same_examples_to_everybody_and_never_in_the_own_cell() -> None:
    now = begin("driver", seed=3)
    practice = now.spec.model_copy(update={"phase": "practice", "bundle": None, "start": "alone"})
    here = trial.start(practice)
    roads = overlay.road_cells(here.spec.task)
    shown = overlay.examples(here)
    assert shown
    assert all(t.row * 14 + t.col in roads for t in shown)
    for triangle in shown:
        moved = replace(here, cell=triangle.row * 14 + triangle.col)
        assert triangle not in overlay.examples(moved)
    assert saw(here, translation.translate(here, None)).triangle_max == pytest.approx(0.62)


def test_with_the_overlay_off_messages_are_counted_but_nothing_is_drawn() -> None:
    now = begin("driver", seed=3, overlay=False)
    slot = int(np.flatnonzero(now.world.alive[0])[0])
    tokens, gates = [SILENT] * 10, [False] * 10
    tokens[slot], gates[slot] = 2, True
    heard = translation.translate(trial.spoken(now, translation.Said(tuple(tokens), tuple(gates))), CLEAR)
    assert (heard.messages, heard.drawn, heard.triangles) == (1, 0, ())
    assert saw(now, heard).triangle_max is None


def test_the_own_message_is_not_heard() -> None:
    now = begin("driver", seed=3)
    own = translation.Said((SILENT,) * 9 + (0,), (False,) * 9 + (True,))
    heard = translation.translate(trial.spoken(now, own), CLEAR)
    assert (heard.messages, heard.triangles) == (0, ())
