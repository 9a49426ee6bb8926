"""Which marketplace an entry link comes from."""

import re
from collections.abc import Collection, Mapping

from server.recruitment import direct, mturk, personal, prolific
from server.recruitment.arrival import Arrival, ExitLink, Marketplace

PARAMETERS = (*prolific.PARAMETERS, *mturk.PARAMETERS)
VALUE = re.compile(r"[!-~]{1,200}")  # printable ASCII; no marketplace sends anything else


def recognise(query: Mapping[str, str], read: personal.Reader = personal.nobody) -> Arrival:
    """The arrival of a personal link, of the first marketplace whose parameters are there, else a direct one.

    `read` tells whom an invitation names; without it every invitation counts as forged.
    """
    if invited := personal.recognise(query, read):
        return invited
    known = {name: query[name] for name in PARAMETERS if VALUE.fullmatch(query.get(name, ""))}
    return prolific.recognise(known) or mturk.recognise(known) or direct.recognise()


def marketplace_of(query: Mapping[str, str]) -> Marketplace:
    """Where the link says that it comes from; an invitation's signature is not looked at."""
    return recognise(query).marketplace


def exit_link(
    marketplace: str,
    code: str,
    parameters: Mapping[str, str],
    template: str | None,
    submit_hosts: Collection[str] = mturk.SUBMIT_HOSTS,
) -> ExitLink | None:
    """The way back for a finished person; `template` is the study's own completion address with `{code}`."""
    if marketplace == "mturk":
        return mturk.exit_link(code, parameters, submit_hosts)
    if marketplace == "prolific":
        return prolific.exit_link(code, template)
    return direct.exit_link(code, template)
