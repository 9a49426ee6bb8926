"""What may be answered, and one message for what may not."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from server.domain import forms
from server.domain.questionnaire import REQUIRED, AttentionCheck, Item, QuizQuestion, problems
from tests.fakes import definition

CHOICE = Item(key="a", text="Which?", options=("x", "y"))
SCALE = Item(key="a", text="How much?", kind="scale", low="none", high="all")
NUMBER = Item(key="a", text="How old?", kind="number", minimum=18, maximum=120)
TEXT = Item(key="a", text="Why?", kind="text")


@pytest.mark.parametrize(
    ("item", "good", "bad"),
    [
        (CHOICE, ["1", "2"], ["0", "3", "x", "1.0", "-1"]),
        (SCALE, ["0", "5", "100"], ["1", "105", "-5", "5.0", "five"]),
        (NUMBER, ["18", "120", "44.5", "٤٤"], ["17", "121", "old", "1e2", "²", "44,5"]),
        (TEXT, ["because", "=1+1", "x" * 4_000], ["x" * 4_001]),
    ],
)
def test_an_answer_is_one_that_the_question_allows(item: Item, good: list[str], bad: list[str]) -> None:
    assert [item.problem(value) for value in good] == [None] * len(good)
    assert all(item.problem(value) for value in bad)


def test_only_what_is_required_must_be_answered() -> None:
    optional = CHOICE.model_copy(update={"key": "b", "required": False})
    assert problems([CHOICE, optional], {}) == {"a": REQUIRED}
    assert problems([CHOICE, optional], {"a": "1", "b": ""}) == {}


@given(st.integers(-5, 5), st.integers(1, 20), st.integers(1, 5))
def test_a_scale_runs_from_its_minimum_in_equal_steps(low: int, span: int, step: int) -> None:
    if not 2 <= span // step + 1 <= 41:
        return
    scale = Item(key="a", text="b", kind="scale", minimum=low, maximum=low + span, step=step)
    assert [int(value) for value in scale.values] == list(range(low, low + span + 1, step))


@pytest.mark.parametrize(
    "wrong",
    [
        {"options": ("only",)},
        {"kind": "text", "options": ("x", "y")},
        {"kind": "number", "minimum": 5, "maximum": 5},
        {"kind": "scale", "step": 1},
    ],
)
def test_a_question_that_cannot_be_asked_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Item.model_validate({"key": "a", "text": "b"} | wrong)


def test_the_right_answer_is_one_of_the_options() -> None:
    with pytest.raises(ValidationError, match="number of one of the options"):
        QuizQuestion(key="a", text="b", options=("x", "y"), answer=3)
    check = AttentionCheck(key="a", text="b", options=("x", "y"), answer=2, after=1)
    assert (check.is_right("2"), check.is_right("1"), check.is_right("")) == (True, False, False)


def test_no_form_holds_a_right_answer() -> None:
    whole = definition("parent-child", whole=True)
    shown = [forms.quiz(whole, "parent", 1, 1), forms.attention(whole.attention[0])]
    for form in shown:
        assert form.items
        assert all(type(item) is Item for item in form.items)
        assert "answer" not in repr(form)


def test_a_form_is_asked_in_the_block_that_its_name_says() -> None:
    whole = definition("parent-child", whole=True, trials_per_block=20)
    blocks = {name: forms.block_of(whole, name) for name in ("quiz:2", "tlx:1", "trust:0", "probe:0")}
    assert blocks == {"quiz:2": 2, "tlx:1": 1, "trust:0": 0, "probe:0": 0}
    assert [forms.block_of(whole, f"attention:{after}") for after in (1, 20, 21, 40)] == [1, 1, 2, 2]
