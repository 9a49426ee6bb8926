"""Prolific: parameters of the entry link and the way back.

Source: Prolific's documentation of URL parameters; SESSION_ID is the id of the submission.
"""

from collections.abc import Mapping
from urllib.parse import urlencode

from server.recruitment.arrival import Arrival, ExitLink

PARAMETERS = ("PROLIFIC_PID", "STUDY_ID", "SESSION_ID")
HOME = "https://app.prolific.com/submissions"
"""Where people see their own submissions."""
COMPLETE = "https://app.prolific.com/submissions/complete"
PLACEHOLDER = "{{%"
PLACEHOLDERS = "PROLIFIC_PID={{%PROLIFIC_PID%}}&STUDY_ID={{%STUDY_ID%}}&SESSION_ID={{%SESSION_ID%}}"


def recognise(query: Mapping[str, str]) -> Arrival | None:
    """The arrival, where the link names a Prolific participant.

    A link whose placeholders nobody filled in was opened by hand: a preview.
    """
    person = query.get("PROLIFIC_PID", "")
    if not person:
        return None
    found = {name: query[name] for name in PARAMETERS if query.get(name)}
    if PLACEHOLDER in person:
        return Arrival("prolific", preview=True, parameters=found)
    return Arrival("prolific", person, query.get("SESSION_ID") or None, parameters=found)


def exit_link(code: str, template: str | None = None) -> ExitLink:
    """Prolific's completion page for the code; `template` (with `{code}`) replaces it."""
    if template:
        return ExitLink(template.replace("{code}", code))
    return ExitLink(f"{COMPLETE}?{urlencode({'cc': code})}")
