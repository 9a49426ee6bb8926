"""Who arrives by an entry link: the one value that every marketplace's parameters become."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Marketplace = Literal["prolific", "mturk", "list", "direct"]


@dataclass(frozen=True, slots=True)
class Arrival:
    """What an entry link says about a person.

    `external_id` is the marketplace's name for the person (None: direct link, nobody is named);
    `submission_id` its name for this one sitting; `parameters` all that was recognised, as it came;
    a `preview` must not be stored; a `forged` one claims an invitation that this lab did not write.
    """

    marketplace: Marketplace
    external_id: str | None = None
    submission_id: str | None = None
    preview: bool = False
    forged: bool = False
    parameters: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ExitLink:
    """The way back to the marketplace: a link, or with `fields` a form that posts them."""

    url: str
    fields: Mapping[str, str] = field(default_factory=dict)
