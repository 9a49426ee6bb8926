"""What is told at each end that somebody in a study can come to: where they stand, and what to do next."""

from collections.abc import Collection, Mapping
from typing import NamedTuple

from server.domain.money import shown
from server.domain.participation import WENT_THROUGH
from server.domain.participation import State as Standing
from server.domain.study import StudyDefinition
from server.recruitment import mturk, prolific
from server.recruitment.arrival import Arrival, ExitLink
from server.recruitment.recognition import exit_link
from server.services.pages import Page as State
from server.services.recruiters import promised_minor
from server.web.pages import Action, EndPage, Icon


class Told(NamedTuple):
    icon: Icon
    heading: str
    paragraphs: tuple[str, ...]


HEADINGS: Mapping[Standing, str] = {
    Standing.FINISHED: "Thank you, you are finished",
    Standing.FAILED: "Thank you, you are finished",
    Standing.WITHDRAWN: "You have left the study",
    Standing.SCREENED_OUT: "The study ends here for you",
    Standing.TIMED_OUT: "Your time for this study is over",
    Standing.RETURNED: "You have returned your place",
    Standing.REJECTED: "This session is closed",
}
KEPT = "What you did so far is kept, as you allowed."
ERASED = (
    "What you did in the study has been deleted. The identifier that pays you is kept until you are paid."
)
WITH_CODE = "Hand in the code below, so that your time is paid."
BACK = "Please return your place on the site that sent you; that has no consequences for you."
NO_REJECTION = "This is no rejection, and it has no bad consequences for you."
DEVICE = "This device or browser cannot show the game as it is meant."
DEVICES = {
    "phone": "The game needs a computer with a keyboard; it cannot be played on a phone or a tablet.",
    "keyboard": "The game is played with a keyboard, and none was found.",
    "viewport": "The window of this device is too small for the game.",
    "frames": "This device draws pictures too slowly for the game.",
    "browser": "This browser is too old for the game.",
}
"""By what the browser found out about itself."""
SITES = frozenset({"prolific", "mturk"})
"""Marketplaces that people can give a place back to."""
CLOSE = "You may close this window."
NEW_PLACE = "Your site may let you take a new place: then its link brings you back to where you were."
QUIZ_FAILED = "Not every question about the game was answered right, so that the rounds cannot start."
CONTACT = "If you think that this is a mistake, write to {contact}."


def end_page(state: State, submit_hosts: Collection[str] = mturk.SUBMIT_HOSTS) -> EndPage:
    study, told = state.study, told_of(state)
    code = state.code or ""
    link = link_of(state, code, submit_hosts)
    through = state.state in WENT_THROUGH
    return EndPage(
        title=study.title,
        state=state.state.value,
        icon=told.icon,
        heading=told.heading,
        paragraphs=told.paragraphs,
        code=code,
        marketplace=state.marketplace,
        url=link.url if link else None,
        fields=link.fields if link else {},
        rounds_stored=state.progress.rounds_over,
        rounds=state.progress.rounds,
        paid=paid_of(state),
        goes_by_itself=through,
        elsewhere=None if link else home(state.marketplace, state.parameters),
        language=study.texts.language,
        direction=study.texts.direction,
    )


def home(marketplace: str, parameters: Mapping[str, str]) -> Action | None:
    """Where the person's work is listed on the site that sent them; none for who came by a direct link."""
    if marketplace == "prolific":
        return Action("Go to Prolific", prolific.HOME)
    if marketplace == "mturk":
        return Action("Go to Mechanical Turk", mturk.home(parameters))
    return None


def again(study: StudyDefinition) -> Action:
    """For who declined and was not named: the page can be read again, and nothing was kept."""
    return Action("Read about the study again", f"/s/{study.slug}")


def link_of(state: State, code: str, submit_hosts: Collection[str]) -> ExitLink | None:
    if not code:
        return None
    return exit_link(state.marketplace, code, state.parameters, state.study.completion_url, submit_hosts)


def way_back(marketplace: str, has_code: bool) -> str:
    """What to do next, in words; nobody sent those who came by a direct link."""
    if has_code:
        return WITH_CODE
    return BACK if marketplace in SITES else CLOSE


def told_of(state: State) -> Told:
    """The words of an end; whoever failed attention checks is thanked like everybody."""
    study, standing = state.study, state.state
    heading = HEADINGS[standing]
    contact = CONTACT.format(contact=study.contact)
    pay = way_back(state.marketplace, bool(state.code))
    if standing in WENT_THROUGH:
        return Told("good", heading, (study.texts.complete,))
    if standing is Standing.WITHDRAWN:
        return Told("info", heading, (KEPT if state.data_kept else ERASED, pay))
    if standing is Standing.SCREENED_OUT:
        return Told("info", heading, (QUIZ_FAILED, NO_REJECTION, pay, contact))
    others: dict[Standing, Told] = {
        Standing.TIMED_OUT: Told(
            "wait",
            heading,
            (
                "You were away for a while, and your place has been given to somebody else.",
                NEW_PLACE if state.marketplace in SITES else CLOSE,
                contact,
            ),
        ),
        Standing.RETURNED: Told(
            "info",
            heading,
            (
                "Nothing more is expected of you.",
                "If you take a place again on the site that sent you, its link brings you back here.",
            ),
        ),
        Standing.REJECTED: Told(
            "stop",
            heading,
            ("The site that sent you has closed your submission.", contact),
        ),
    }
    return others[standing]


def refused_page(
    study: StudyDefinition,
    status: str,
    arrival: Arrival,
    reason: str = "",
    submit_hosts: Collection[str] = mturk.SUBMIT_HOSTS,
) -> EndPage:
    """The end of who declined, or whose device does not fit, before anything was begun."""
    declined = status == "declined"
    code = "" if declined else study.codes.screened_out
    named = arrival.external_id is not None
    link = None
    if code:
        way = (arrival.marketplace, code, arrival.parameters, study.completion_url)
        link = exit_link(*way, submit_hosts)
    back = way_back(arrival.marketplace, bool(code) and named)
    why = (study.texts.declined,) if declined else (DEVICES.get(reason, DEVICE), NO_REJECTION)
    return EndPage(
        title=study.title,
        state=status,
        icon="info",
        heading="You do not take part" if declined else "This study needs another device",
        paragraphs=(*why, *(() if declined and not named else (back,))),
        code=code if named else "",
        marketplace=arrival.marketplace,
        url=link.url if link and named else None,
        fields=link.fields if link and named else {},
        rounds_stored=0,
        rounds=0,
        paid=(),
        goes_by_itself=False,
        elsewhere=None if link and named else home(arrival.marketplace, arrival.parameters) or again(study),
        language=study.texts.language,
        direction=study.texts.direction,
    )


def paid_of(state: State) -> tuple[tuple[str, str], ...]:
    """What will be paid, line by line."""
    pay = state.study.pay
    if pay is None:
        return ()
    lines = []
    if reward := promised_minor(pay, state.marketplace, state.state, state.code or ""):
        lines.append(("For your time", shown(reward, pay.currency)))
    if state.state in WENT_THROUGH and pay.bonus_success_minor:
        won = f"Bonus for {state.progress.won} of {state.progress.rounds} rounds"
        lines.append((won, shown(state.progress.bonus_minor, pay.currency)))
    return tuple(lines)
