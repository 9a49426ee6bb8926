"""Questions as data: what is asked, what may be answered, and one message for each answer that cannot be.

An answer is text: of a choice the number of the option (from 1), of a scale or a number its value, of a text
what was written; a mark on a board is `row,column` from 0. What was not answered has no answer.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

Key = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=600)]
Label = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=160)]
Kind = Literal["choice", "scale", "number", "text"]

TEXT_MAX = 4_000
REQUIRED = "Please answer this question."
NUMBER = re.compile(r"-?\d{1,9}(\.\d{1,6})?")


class Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Item(Part):
    """One question.

    `choice`: one of `options`. `scale`: one of `minimum`, `minimum + step`, … `maximum`, between the anchors
    `low` and `high`, with no value beforehand. `number`: within the bounds. `text`: free.
    """

    key: Key
    text: Text
    kind: Kind = "choice"
    options: tuple[Label, ...] = Field(default=(), max_length=40)
    low: Label | None = None
    high: Label | None = None
    minimum: float = 0
    maximum: float = 100
    step: float = Field(default=5, gt=0)
    required: bool = True

    @model_validator(mode="after")
    def fits(self) -> "Item":
        if (self.kind == "choice") != (len(self.options) >= 2):
            raise ValueError("a choice needs two options or more, and nothing else has options")
        if self.minimum >= self.maximum:
            raise ValueError("minimum must be less than maximum")
        if self.kind == "scale" and not 2 <= len(self.values) <= 41:
            raise ValueError("a scale has 2 to 41 values: change minimum, maximum or step")
        return self

    @property
    def values(self) -> tuple[str, ...]:
        """What can be answered, where that is a list."""
        if self.kind == "choice":
            return tuple(str(number) for number in range(1, len(self.options) + 1))
        if self.kind == "scale":
            count = math.floor((self.maximum - self.minimum) / self.step + 1e-9) + 1
            return tuple(f"{self.minimum + index * self.step:g}" for index in range(count))
        return ()

    def problem(self, value: str) -> str | None:
        """What is wrong with an answer; None if nothing is. An empty one is no answer."""
        if not value:
            return REQUIRED if self.required else None
        if self.values:
            return None if value in self.values else "Please choose one of the answers."
        if self.kind == "number":
            within = NUMBER.fullmatch(value) and self.minimum <= float(value) <= self.maximum
            return None if within else f"Please type a number from {self.minimum:g} to {self.maximum:g}."
        return None if len(value) <= TEXT_MAX else f"Please shorten this to {TEXT_MAX} characters."

    def label(self, value: str) -> str:
        """The words of an answer: of a choice its option, else nothing."""
        number = int(value) if value.isdecimal() else 0
        return self.options[number - 1] if 1 <= number <= len(self.options) else ""


class Question(Item):
    """A question with a right answer: of the comprehension quiz, or an attention check."""

    answer: int = Field(ge=1)
    """Number of the right option, from 1. It never leaves the server before it was given."""

    @model_validator(mode="after")
    def has_its_answer(self) -> "Question":
        if self.kind != "choice" or self.answer > len(self.options):
            raise ValueError("answer must be the number of one of the options")
        return self

    def is_right(self, value: str) -> bool:
        return value == str(self.answer)


class QuizQuestion(Question):
    """Asked of who is about to play `role`; without one, before every block."""

    role: Literal["parent", "child", "driver"] | None = None


class AttentionCheck(Question):
    after: int = Field(ge=1)
    """Comes when so many main rounds of the session have ended."""


class Questionnaire(Part):
    key: Key
    title: Label
    lead: Text | None = None
    when: Literal["block", "end"] = "end"
    items: tuple[Item, ...] = Field(min_length=1, max_length=60)


def problems(items: Sequence[Item], answers: Mapping[str, str]) -> dict[str, str]:
    """Messages by item; empty when everything can be stored."""
    return dict(_problems(items, answers))


def _problems(items: Sequence[Item], answers: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    for item in items:
        if (wrong := item.problem(answers.get(item.key, ""))) is not None:
            yield item.key, wrong


def repeated(keys: Sequence[str]) -> str | None:
    """The first key that stands twice."""
    return next((key for index, key in enumerate(keys) if key in keys[:index]), None)
