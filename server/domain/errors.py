"""What can go wrong, as one tree.

Every error says in one line what happened and what to do; `status` is its HTTP status.

HatlabError
├── NotFoundError 404      no such study, session or round
├── ClosedError 403        the study takes nobody at the moment (paused, closed, full)
├── StaleError 409         the step was already taken, or is not open yet; carries the current view
├── BadInputError 422      a value that no page of ours sends; names the field
│   └── DefinitionError    a study that cannot be launched; one message per field
├── NotReadyError 503      the server lacks something: a migration, a bundle, the database
└── CorruptError 500       stored data contradict themselves; `hatlab verify` names the place
"""

from collections.abc import Mapping
from typing import Any, ClassVar


class HatlabError(Exception):
    status: ClassVar[int] = 500
    title: ClassVar[str] = "Something went wrong"

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail


class NotFoundError(HatlabError):
    status = 404
    title = "Not found"


class ClosedError(HatlabError):
    status = 403
    title = "Closed"


class StaleError(HatlabError):
    status = 409
    title = "Already answered"

    def __init__(self, detail: str, view: Mapping[str, Any]) -> None:
        super().__init__(detail)
        self.view = view


class BadInputError(HatlabError):
    status = 422
    title = "Not accepted"


class DefinitionError(BadInputError):
    title = "The study has errors"

    def __init__(self, fields: Mapping[str, str]) -> None:
        super().__init__("; ".join(f"{field}: {message}" for field, message in fields.items()))
        self.fields = dict(fields)


class NotReadyError(HatlabError):
    status = 503
    title = "Not ready"


class CorruptError(HatlabError):
    status = 500
    title = "Stored data contradict themselves"
