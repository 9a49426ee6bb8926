"""Mechanical Turk: parameters of an ExternalQuestion and the form that ends an assignment.

The page stands in an iframe of the worker site. A preview (no assignment yet) must store nothing.
Source: the ExternalQuestion article of the MTurk API reference.
"""

from collections.abc import Collection, Mapping

from server.recruitment.arrival import Arrival, ExitLink

PARAMETERS = ("workerId", "assignmentId", "hitId", "turkSubmitTo")
NO_ASSIGNMENT = "ASSIGNMENT_ID_NOT_AVAILABLE"
SUBMIT_HOSTS = ("https://www.mturk.com", "https://workersandbox.mturk.com")  # anything else: open redirect
FRAME_HOSTS = ("https://worker.mturk.com", *SUBMIT_HOSTS)

HOME, SANDBOX_HOME = "https://worker.mturk.com", "https://workersandbox.mturk.com"


def home(parameters: Mapping[str, str]) -> str:
    """The worker site that the link came from; workers of the sandbox go back to the sandbox."""
    return SANDBOX_HOME if parameters.get("turkSubmitTo", "").startswith(SANDBOX_HOME) else HOME


def frame_hosts(extra: str = "") -> tuple[str, ...]:
    """Who may embed a worker's pages; `extra` is the setting `mturk_extra_host`."""
    return (*FRAME_HOSTS, extra) if extra else FRAME_HOSTS


def submit_hosts(extra: str = "") -> tuple[str, ...]:
    """Who may be sent the form that ends an assignment."""
    return (*SUBMIT_HOSTS, extra) if extra else SUBMIT_HOSTS


def recognise(query: Mapping[str, str]) -> Arrival | None:
    """The arrival, where the link comes from MTurk; a preview has no worker and no assignment."""
    assignment = query.get("assignmentId", "")
    if not assignment:
        return None
    found = {name: query[name] for name in PARAMETERS if query.get(name)}
    worker = query.get("workerId", "")
    if assignment == NO_ASSIGNMENT or not worker:
        return Arrival("mturk", preview=True, parameters=found)
    return Arrival("mturk", worker, assignment, parameters=found)


def exit_link(code: str, parameters: Mapping[str, str], hosts: Collection[str]) -> ExitLink | None:
    """The form that submits the assignment; none where `turkSubmitTo` is not one of these hosts."""
    host = parameters.get("turkSubmitTo", "").rstrip("/")
    assignment = parameters.get("assignmentId", "")
    if host not in hosts or not assignment:
        return None
    return ExitLink(f"{host}/mturk/externalSubmit", {"assignmentId": assignment, "code": code})
