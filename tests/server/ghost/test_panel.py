from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from server.ghost import panel
from tests.fakes import fake_bundle

SEEDS = st.integers(0, 2**53 - 1)


def test_in_the_prototype_arm_every_token_stands_at_its_own_position() -> None:
    assert panel.token_places("prototype", 7, 9) == list(range(9))


@given(SEEDS)
def test_in_the_other_arms_positions_are_permuted_for_each_participant(seed: int) -> None:
    for communication in ("one-hot", "shuffled"):
        assert sorted(panel.token_places(communication, seed, 9)) == list(range(9))
    assert panel.token_places("one-hot", seed, 9) == panel.token_places("one-hot", seed, 9)


def test_every_token_comes_to_every_position_equally_often() -> None:
    places = Counter(
        (t, p) for seed in range(2_700) for t, p in enumerate(panel.token_places("one-hot", seed, 9))
    )
    assert len(places) == 81
    assert all(220 <= count <= 380 for count in places.values())


@given(SEEDS)
def test_numbers_run_from_one_and_do_not_follow_the_places(seed: int) -> None:
    assert sorted(panel.position_numbers(seed, 9)) == list(range(1, 10))


def test_numbers_and_places_are_drawn_apart() -> None:
    seeds = range(200)
    same = sum(
        [n - 1 for n in panel.position_numbers(seed, 9)] == panel.token_places("one-hot", seed, 9)
        for seed in seeds
    )
    assert same == 0


def test_the_panel_bundle_gives_the_positions_and_numbers_lead_back_to_tokens() -> None:
    bundle = fake_bundle("parent_child/prototype-9")
    places, numbers = panel.token_places("one-hot", 3, 9), panel.position_numbers(3, 9)
    made = panel.panel(bundle, places, numbers)
    assert made.sha256 == bundle.sha256
    for token in range(9):
        number = made.number_of(token)
        assert numbers[places[token]] == number
        assert made.token_of(number) == token
    x, y = bundle.lexicon.positions[4]
    assert made.positions[4] == (round(float(x), 4), round(float(y), 4))
