from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.domain.plan import forms_of, has_left, missing, permutation, plan
from tests.fakes import definition

SEEDS = st.integers(0, 2**53 - 1)
SEARCH = definition("parent-child", trials_per_block=20)
DRIVE = definition("traffic-junction", trials_per_block=20)


@given(SEEDS)
def test_everybody_plays_the_same_situations_in_an_order_of_their_own(seed: int) -> None:
    mine, other = plan(SEARCH, "parent-child", seed), plan(SEARCH, "child-parent", seed + 1)
    for role in ("parent", "child"):
        seeds = [r.seed for r in mine.rounds if r.role == role and r.phase == "main"]
        others = [r.seed for r in other.rounds if r.role == role and r.phase == "main"]
        assert sorted(seeds) == sorted(others)
        assert len(set(seeds)) == 20


def test_the_order_of_rounds_differs_between_participants() -> None:
    orders = {tuple(r.situation for r in plan(DRIVE, "driver", seed).rounds) for seed in range(50)}
    assert len(orders) == 50


def test_roles_have_situations_of_their_own_and_practice_too() -> None:
    rounds = plan(SEARCH, "parent-child", 1).rounds
    assert len({r.seed for r in rounds}) == len(rounds)


def test_a_session_has_its_pages_and_rounds_in_order() -> None:
    mine = plan(SEARCH, "child-parent", 5)
    assert mine.pages == ("instructions:1", "play:1", "instructions:2", "play:2", "complete")
    assert [r.round for r in mine.rounds] == list(range(1, 43))
    assert [r.role for r in mine.rounds] == ["child"] * 21 + ["parent"] * 21
    assert [(r.phase, r.number, r.of) for r in mine.of_block(2)[:3]] == [
        ("practice", 1, 1),
        ("main", 1, 20),
        ("main", 2, 20),
    ]
    assert [r.round for r in mine.rounds if r.last] == [21, 42]
    assert mine.page_after("complete") == "complete"


def test_a_whole_study_has_its_pages_in_order() -> None:
    mine = plan(definition("parent-child", whole=True), "child-parent", 5)
    assert mine.pages == (
        *("instructions:1", "practice:1", "quiz:1", "play:1", "survey:1"),
        *("instructions:2", "practice:2", "quiz:2", "play:2", "survey:2"),
        *("probe:0", "survey:0", "complete"),
    )
    assert [r.phase for r in mine.of_page("practice:1")] == ["practice"]
    assert {r.phase for r in mine.of_page("play:1")} == {"main"}
    assert mine.of_page("quiz:1") == mine.of_page("survey:0") == ()
    drive = definition("traffic-junction", whole=True)
    assert plan(drive, "driver", 5).pages == (
        *("instructions:1", "practice:1", "quiz:1", "play:1", "survey:1"),
        *("survey:0", "complete"),
    )


def test_whoever_finishes_has_handed_in_every_form_of_the_study() -> None:
    whole = definition("parent-child", whole=True)
    assert sorted(forms_of(whole, plan(whole, "parent-child", 1))) == sorted(
        [
            *("quiz:1", "quiz:2", "attention:2", "attention:4", "tlx:1", "tlx:2", "probe:0"),
            *("trust:0", "demographics:0", "comment:0"),
        ]
    )


def test_without_practice_the_quiz_follows_the_instructions() -> None:
    pages = plan(definition("traffic-junction", whole=True, practice_rounds=0), "driver", 1).pages
    assert pages[:3] == ("instructions:1", "quiz:1", "play:1")


def test_without_practice_the_first_round_counts() -> None:
    rounds = plan(definition("traffic-junction", practice_rounds=0), "driver", 1).rounds
    assert [(r.phase, r.number) for r in rounds] == [("main", 1), ("main", 2), ("main", 3)]


@given(SEEDS, st.integers(1, 30))
def test_a_permutation_holds_everything_once(seed: int, size: int) -> None:
    assert sorted(permutation(seed, 9, 0, size)) == list(range(size))


def test_permutations_are_drawn_uniformly() -> None:
    counts = Counter(tuple(permutation(seed, 9, 0, 3)) for seed in range(6_000))
    assert len(counts) == 6
    assert all(count == pytest.approx(1_000, abs=110) for count in counts.values())


def test_rounds_that_have_not_ended_are_named() -> None:
    mine = plan(definition("traffic-junction"), "driver", 1)
    assert missing(mine, [(1, "arrived"), (2, None), (4, "limit")]) == [2, 3]


def test_who_was_not_seen_within_the_lease_has_left() -> None:
    assert has_left("active", "2026-01-01T00:00:00.000Z", "2026-01-01T00:00:00.001Z")
    assert not has_left("active", "2026-01-01T00:00:00.001Z", "2026-01-01T00:00:00.001Z")
    assert not has_left("finished", "2026-01-01T00:00:00.000Z", "2026-01-02T00:00:00.000Z")


def test_seeds_are_exact_in_a_spreadsheet() -> None:
    assert all(r.seed < 2**53 for r in plan(SEARCH, "parent-child", 1).rounds)
