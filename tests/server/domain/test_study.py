import tomllib
from typing import Any

import pytest

from server.domain import study
from server.domain.errors import DefinitionError
from server.domain.study import Offer
from tests.fakes import STUDIES, definition

OFFERS = {
    "parent_child/prototype-9": Offer("parent_child/prototype-9", "parent_child", "prototype", 9, 1.0),
    "parent_child/onehot-9": Offer("parent_child/onehot-9", "parent_child", "one-hot", 9, 1.0),
}


def values(slug: str) -> dict[str, Any]:
    return tomllib.loads((STUDIES / f"{slug}.toml").read_text())


def errors(which: str, **changes: Any) -> dict[str, str]:
    with pytest.raises(DefinitionError) as caught:
        study.read(values(which) | changes)
    return caught.value.fields


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
def test_the_packaged_studies_are_the_papers(slug: str) -> None:
    packaged = study.read(values(slug))
    assert packaged.slug == slug
    assert packaged.trials_per_block == 20
    assert packaged.step_limit == {"parent-child": 20, "traffic-junction": 40}[slug]
    assert any("must replace it" in paragraph for paragraph in packaged.texts.consent)


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
def test_a_packaged_study_pays_nine_pounds_an_hour_or_more_and_its_caps_hold_everybody(slug: str) -> None:
    packaged = study.read(values(slug))
    pay = packaged.pay
    assert pay is not None
    assert pay.currency == "GBP"
    assert pay.reward_minor * 60 / packaged.duration_min >= 900
    assert pay.bonus_max_minor == pay.bonus_success_minor * packaged.main_rounds
    assert pay.cap_study_minor >= pay.cap_participant_minor * packaged.places


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
def test_a_packaged_study_asks_about_every_role_and_checks_attention_twice(slug: str) -> None:
    packaged = study.read(values(slug))
    for role in packaged.roles:
        assert len(packaged.quiz_of(role)) >= 3  # type: ignore[arg-type]
    assert {question.answer for question in packaged.quiz} == {1, 2, 3}
    assert [check.after for check in packaged.attention] == {
        "parent-child": [12, 28],
        "traffic-junction": [7, 14],
    }[slug]
    assert (packaged.quiz_tries, packaged.attention_failures) == (2, 2)
    assert packaged.token_probe == (slug == "parent-child")


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
def test_the_load_index_has_six_scales_of_21_values(slug: str) -> None:
    [asked] = study.read(values(slug)).questionnaires_at("block")
    assert asked.key == "tlx"
    assert [item.key for item in asked.items] == [
        "mental",
        "physical",
        "temporal",
        "performance",
        "effort",
        "frustration",
    ]
    assert all(item.values == tuple(str(value) for value in range(0, 101, 5)) for item in asked.items)
    assert {(item.low, item.high) for item in asked.items} == {
        ("Very low", "Very high"),
        ("Perfect", "Failure"),
    }


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
def test_a_packaged_study_says_what_it_records_and_what_declining_leaves(slug: str) -> None:
    texts = study.read(values(slug)).texts
    said = " ".join(texts.consent)
    for words in ("answers to the questions", "in front", "scrambled form", "that fact and the date"):
        assert words in said
    assert "scrambled form" in texts.declined
    assert "the date" in texts.declined


def test_a_launched_version_reads_back_as_the_same_text() -> None:
    packaged = definition("traffic-junction")
    again = study.from_json(packaged.canonical)
    assert again == packaged
    assert again.canonical == packaged.canonical
    assert again.sha256 == packaged.sha256


def test_any_change_changes_the_hash() -> None:
    assert definition("parent-child").sha256 != definition("parent-child", lease_min=61).sha256


@pytest.mark.parametrize(
    ("slug", "field", "value"),
    [
        ("parent-child", "slug", "Not A Slug"),
        ("parent-child", "title", "  "),
        ("parent-child", "trials_per_block", 0),
        ("parent-child", "step_limit", 21),
        ("parent-child", "panel_bundle", None),
        ("parent-child", "environment", "traffic_junction/medium"),
        ("parent-child", "completion_code", "no spaces"),
        ("parent-child", "completion_url", "http://example.org/{code}"),
        ("parent-child", "completion_url", "http://127.0.0.1@example.org/{code}"),
        ("parent-child", "completion_url", "http://127.0.0.1.example.org/{code}"),
        ("parent-child", "completion_url", "https://example.org/"),
        ("parent-child", "arms", []),
        ("parent-child", "surprise", 1),
        ("traffic-junction", "arrival", 1.5),
        ("traffic-junction", "step_limit", 41),
        ("traffic-junction", "panel_bundle", "parent_child/prototype-9"),
        ("traffic-junction", "environment", "traffic_junction/huge"),
        ("traffic-junction", "situation_seed", 2**53),
    ],
)
def test_a_wrong_field_is_named(slug: str, field: str, value: object) -> None:
    assert field in errors(slug, **{field: value})


def test_a_wrong_field_of_an_arm_is_named_with_its_number() -> None:
    arms = values("traffic-junction")["arms"]
    arms[1] |= {"name": arms[0]["name"], "communication": "one-hot"}
    arms[2] |= {"budget": 0}
    assert "arms.2.budget" in errors("traffic-junction", arms=arms)
    arms[2] |= {"budget": 0.3}
    assert set(errors("traffic-junction", arms=arms)) == {"arms.1.name", "arms.1.communication"}


def test_a_study_whose_agents_are_there_can_be_launched() -> None:
    assert study.misfits(definition("parent-child"), OFFERS) == {}


def test_agents_that_are_not_there_are_named_at_their_field() -> None:
    wrong = study.misfits(definition("parent-child"), {})
    assert set(wrong) == {"panel_bundle", "arms.0.bundle", "arms.1.bundle"}


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"channel": "prototype"}, "arms.1.communication"),
        ({"budget": 0.5}, "arms.1.budget"),
        ({"environment": "traffic_junction/easy"}, "arms.1.bundle"),
        ({"tokens": 8}, "arms.1.bundle"),
    ],
)
def test_an_agent_that_does_not_fit_is_named_at_its_field(change: dict[str, Any], field: str) -> None:
    misfit = {"name": "x", "environment": "parent_child", "channel": "one-hot", "tokens": 9, "budget": 1.0}
    offers = OFFERS | {"parent_child/onehot-9": Offer(**(misfit | change))}
    assert list(study.misfits(definition("parent-child"), offers)) == [field]


def test_people_get_at_most_nine_signs() -> None:
    many = Offer("parent_child/prototype-9", "parent_child", "prototype", 12, 1.0)
    wrong = study.misfits(definition("parent-child"), OFFERS | {"parent_child/prototype-9": many})
    assert "at most 9" in wrong["panel_bundle"]
