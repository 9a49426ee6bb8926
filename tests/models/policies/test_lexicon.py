import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from models.policies.lexicon import Lexicon, LexiconError, occupancy

SPREAD = np.linspace(0.1, 0.9, 6).reshape(3, 2)


def lexicon(counts: object = ((40, 0, 0, 0), (10, 10, 10, 10), (0, 0, 30, 10))) -> Lexicon:
    return Lexicon.from_counts(counts, positions=SPREAD, explained=(0.7, 0.2), seed=3)


def test_rows_are_relative_frequencies_of_the_speakers_cell() -> None:
    made = lexicon()
    assert made.probability[2].tolist() == [0, 0, 0.75, 0.25]
    assert made.uses.tolist() == [40, 40, 40]
    assert made.samples == 120


def test_entropy_is_in_bits() -> None:
    assert lexicon().entropy_bits[:2] == pytest.approx([0, 2])


def test_a_token_that_tells_nothing_about_the_place_is_null() -> None:
    made = Lexicon.from_counts([[300, 0, 90, 100], [305, 20, 85, 95], [0, 0, 90, 10]], positions=SPREAD)
    base = np.array([605, 20, 265, 205]) / 1095
    told = [
        sum(p * np.log2(p / q) for p, q in zip(row, base, strict=True) if p > 0) for row in made.probability
    ]
    limit = 0.1 * -sum(q * np.log2(q) for q in base)
    assert made.null.tolist() == [bool(value < limit) for value in told]
    assert made.null.any()
    assert not made.null.all()


def test_a_token_never_or_rarely_used_is_null_and_claims_only_the_base_rate() -> None:
    made = lexicon([[100, 0, 0, 0], [0, 0, 100, 0], [0, 0, 0, 2]])
    assert made.null.tolist() == [False, False, True]
    assert made.probability[2] == pytest.approx([100 / 202, 0, 100 / 202, 2 / 202])


def test_the_likelihood_of_a_cell_is_one_minus_the_product_of_the_misses() -> None:
    made = lexicon()
    heard = occupancy(made, np.array([0, 2, 2], np.int32), np.array([True, True, True]))
    assert heard == pytest.approx([1, 0, 1 - 0.25**2, 1 - 0.75**2])


def test_closed_gates_silent_seats_and_null_tokens_draw_nothing() -> None:
    made = lexicon([[40, 0, 0, 0], [40, 40, 40, 40], [0, 0, 0, 0]])
    assert made.null.tolist() == [False, True, True]
    heard = occupancy(made, np.array([0, 1, -1, 2], np.int32), np.array([False, True, True, True]))
    assert heard.tolist() == [0, 0, 0, 0]


def test_no_message_means_no_likelihood_anywhere() -> None:
    assert occupancy(lexicon(), np.zeros(0, np.int32), np.zeros(0, bool)).tolist() == [0, 0, 0, 0]


@given(arrays(np.int64, (3, 4), elements=st.integers(0, 50)), st.lists(st.integers(-1, 2), max_size=6))
def test_every_row_is_a_distribution_and_every_likelihood_a_probability(
    counts: np.ndarray, heard: list[int]
) -> None:
    made = lexicon(counts)
    assert np.allclose(made.probability.sum(axis=1), 1)
    likelihood = occupancy(made, np.array(heard, np.int32), np.ones(len(heard), bool))
    assert ((likelihood >= 0) & (likelihood <= 1)).all()


@given(arrays(np.int64, (3, 4), elements=st.integers(0, 50)))
def test_json_gives_back_the_same_numbers(counts: np.ndarray) -> None:
    made = lexicon(counts)
    back = Lexicon.from_json(json.loads(json.dumps(made.to_json())))
    for name in ("probability", "uses", "entropy_bits", "null", "positions", "explained", "coordinates"):
        assert np.array_equal(getattr(back, name), getattr(made, name)), name
    assert (back.samples, back.seed, back.tokens, back.cells) == (made.samples, 3, 3, 4)


@pytest.mark.parametrize(
    ("field", "value", "complaint"),
    [
        ("probability", [[0.5, 0, 0, 0]] * 3, "probability has a row that does not sum to 1"),
        ("probability", [[1, 0, 0, 0]] * 2, r"probability has shape \(2, 4\)"),
        ("probability", [[2, -1, 0, 0]] * 3, "probability has a row"),
        ("probability", "all", "probability is not an array"),
        ("probability", None, "probability"),
        ("uses", [1, 1, 1], "uses do not sum to samples"),
        ("entropy_bits", [1, 1, 1], "entropy_bits do not belong"),
        ("null", [True], "null has shape"),
        ("positions", [[0, 0], [0, 0], [2, 0]], "positions leave the unit square"),
        ("explained", [1], "explained has shape"),
        ("tokens", -1, "tokens must be a whole number"),
        ("cells", 1.5, "cells must be a whole number"),
        ("samples", True, "samples must be a whole number"),
    ],
)
def test_a_lexicon_that_contradicts_itself_is_refused_by_name(
    field: str, value: object, complaint: str
) -> None:
    with pytest.raises(LexiconError, match=complaint):
        Lexicon.from_json({**lexicon().to_json(), field: value})


def test_a_missing_field_is_named() -> None:
    data = lexicon().to_json()
    del data["uses"]
    with pytest.raises(LexiconError, match="uses is missing"):
        Lexicon.from_json(data)
