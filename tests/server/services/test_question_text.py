"""Questions survive the way to TOML and back, whatever they say."""

import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.domain import study
from server.domain.questionnaire import AttentionCheck, Item, Questionnaire, QuizQuestion
from server.services.question_text import SHAPES, mistake, parsed, written
from tests.fakes import STUDIES, definition

WORDS = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=30).filter(str.strip)
KEYS = st.from_regex(r"[a-z][a-z0-9_]{0,10}", fullmatch=True)
ITEMS = st.one_of(
    st.builds(
        Item,
        key=KEYS,
        text=WORDS,
        options=st.lists(WORDS, min_size=2, max_size=4).map(tuple),
        required=st.booleans(),
    ),
    st.builds(
        Item,
        key=KEYS,
        text=WORDS,
        kind=st.just("number"),
        low=st.none() | WORDS,
        minimum=st.floats(-1e6, 0),
        maximum=st.floats(1, 1e6) | st.integers(1, 10**6),
    ),
)
ASKED = st.builds(
    Questionnaire,
    key=KEYS,
    title=WORDS,
    lead=st.none() | WORDS,
    when=st.sampled_from(["block", "end"]),
    items=st.lists(ITEMS, min_size=1, max_size=3).map(tuple),
)


@given(st.lists(ASKED, max_size=3))
def test_what_was_written_reads_back_as_the_same_questionnaires(asked: list[Questionnaire]) -> None:
    text = written("questionnaires", [each.model_dump(mode="json") for each in asked])
    assert [Questionnaire.model_validate(each) for each in parsed("questionnaires", text)] == asked


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
@pytest.mark.parametrize("name", SHAPES)
def test_the_questions_of_the_packaged_studies_read_back_as_they_are(slug: str, name: str) -> None:
    whole = definition(slug, whole=True).model_dump(mode="json")
    assert study.read(whole | {name: parsed(name, written(name, whole[name]))}) == study.read(whole)
    packaged = tomllib.loads((STUDIES / f"{slug}.toml").read_text())[name]
    assert parsed(name, written(name, packaged)) == packaged


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**9), 10**9) | WORDS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=8,
)


@given(st.lists(st.dictionaries(WORDS, JSON, max_size=4), min_size=1, max_size=2))
def test_whatever_a_draft_holds_becomes_toml_that_can_be_read(parts: list[dict[str, Any]]) -> None:
    assert isinstance(parsed("quiz", written("quiz", parts)), list)


@given(st.text(max_size=60) | st.sampled_from(["[" * 5_000, "a = 1_", "quiz = [nan]", "quiz = 1:2"]))
def test_any_text_is_a_list_or_has_a_mistake_in_one_sentence(text: str) -> None:
    found = parsed("quiz", text)
    if isinstance(found, str):
        assert found == text
        assert mistake("quiz", text).endswith(".")


def test_what_goes_without_saying_is_left_out() -> None:
    check = AttentionCheck(key="a", text="b", options=("c", "d"), answer=2, after=3)
    assert written("attention", [check.model_dump(mode="json")]) == (
        '[[attention]]\nkey = "a"\nafter = 3\ntext = "b"\noptions = ["c", "d"]\nanswer = 2'
    )
    question = QuizQuestion(key="a", text="b", options=("c", "d"), answer=1, required=False)
    assert "required = false" in written("quiz", [question.model_dump(mode="json")])
