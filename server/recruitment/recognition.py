"""Which marketplace an entry link comes from."""

import re
from collections.abc import Mapping

from server.recruitment import direct, mturk, prolific
from server.recruitment.arrival import Arrival, ExitLink

PARAMETERS = (*prolific.PARAMETERS, *mturk.PARAMETERS)
VALUE = re.compile(r"[!-~]{1,200}")  # printable ASCII; no marketplace sends anything else


def recognise(query: Mapping[str, str]) -> Arrival:
    """The arrival of the first marketplace whose parameters are there, else a direct one."""
    known = {name: query[name] for name in PARAMETERS if VALUE.fullmatch(query.get(name, ""))}
    return prolific.recognise(known) or mturk.recognise(known) or direct.recognise()


def exit_link(
    marketplace: str, code: str, parameters: Mapping[str, str], template: str | None
) -> ExitLink | None:
    """The way back for a finished person; `template` is the study's own completion address with `{code}`."""
    if marketplace == "mturk":
        return mturk.exit_link(code, parameters)
    if marketplace == "prolific":
        return prolific.exit_link(code, template)
    return direct.exit_link(code, template)
