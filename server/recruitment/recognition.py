"""Which marketplace an entry link comes from."""

from collections.abc import Mapping

from server.recruitment import direct, mturk, prolific
from server.recruitment.arrival import Arrival, ExitLink

PARAMETERS = (*prolific.PARAMETERS, *mturk.PARAMETERS)
PARAMETER_MAX = 200  # characters; longer ones are no marketplace's


def recognise(query: Mapping[str, str]) -> Arrival:
    """The arrival of the first marketplace whose parameters are there, else a direct one."""
    short = {
        name: value for name, value in query.items() if name in PARAMETERS and len(value) <= PARAMETER_MAX
    }
    return prolific.recognise(short) or mturk.recognise(short) or direct.recognise()


def exit_link(
    marketplace: str, code: str, parameters: Mapping[str, str], template: str | None
) -> ExitLink | None:
    """The way back for a finished person; `template` is the study's own completion address with `{code}`."""
    if marketplace == "mturk":
        return mturk.exit_link(code, parameters)
    if marketplace == "prolific":
        return prolific.exit_link(code, template)
    return direct.exit_link(code, template)
