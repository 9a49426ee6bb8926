"""Our state beside the marketplace's: every mismatch, with the one thing that is proposed about it.

Pure: `mismatches` compares what is stored here with what a marketplace told. Nothing is done by it. Money is
proposed once for each person and purpose; what stands in the ledger is not proposed again. Nobody is ever
proposed to be rejected.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from server.domain.participation import ACTIVE, WENT_THROUGH
from server.domain.study import Pay

ActionKind = Literal["approve", "bonus", "partial", "screen_out", "ask_return", "follow", "look"]
"""`partial` pays the partial reward as a bonus; `follow` takes the marketplace's word into our state; `look`
is for a person: nothing can be done from here."""

MONEY: frozenset[ActionKind] = frozenset({"approve", "bonus", "partial", "screen_out"})
OVER = frozenset({"approved", "partially_approved", "returned", "timed_out", "rejected", "screened_out"})
GIVEN_BACK = frozenset({"returned", "timed_out", "rejected"})
PAID = frozenset({"approved", "partially_approved"})


@dataclass(frozen=True, slots=True)
class Ours:
    """A person as we know them. `participant_id` is empty for who only declined or was screened out."""

    participant_id: str
    external_hash: str
    submission_id: str
    status: str
    """`active`, one of the ends, `declined`."""
    code: str
    bonus_minor: int
    partial_minor: int = 0
    """What who withdrew was promised; of the version that they entered, like the bonus."""
    must_be_listed: bool = True
    """False for who came in by another posting, or in another mode: this list need not hold them."""


@dataclass(frozen=True, slots=True)
class Site:
    """What a marketplace can do."""

    lists_everybody: bool = True
    """It also tells of people who have not handed in."""
    pays_in_parts: bool = True
    """What was handed in can be screened out or given back; else it is paid whole, or rejected."""


@dataclass(frozen=True, slots=True)
class Theirs:
    """A submission as the marketplace tells it."""

    submission_id: str
    external_hash: str
    state: str
    code: str


@dataclass(frozen=True, slots=True)
class Mismatch:
    """One difference. `key` names it for good: the same difference has the same key at every look."""

    key: str
    participant_id: str
    submission_id: str
    ours: str
    theirs: str
    says: str
    action: ActionKind
    amount_minor: int = 0


def key_of(action: ActionKind, submission_id: str) -> str:
    return f"{action}:{submission_id}"


def mismatches(
    ours: Sequence[Ours],
    theirs: Sequence[Theirs],
    ledger: Mapping[str, str],
    pay: Pay | None,
    site: Site = Site(),
) -> list[Mismatch]:
    """All differences, in the order of submissions.

    Args:
        ours: everybody who came from this posting.
        theirs: every submission of it.
        ledger: state of every payment or request so far (`sent`, `done`, `failed`) by mismatch key.
        pay: what the study pays; None: nothing is proposed that costs.
        site: what the marketplace can do.
    """
    by_submission = {person.submission_id: person for person in ours if person.submission_id}
    by_hash = {person.external_hash: person for person in ours}
    found: list[Mismatch] = []
    for their in sorted(theirs, key=lambda each: each.submission_id):
        person = by_submission.get(their.submission_id)
        if person is None and (other := by_hash.get(their.external_hash)) is not None:
            if not other.submission_id:
                person = other  # declined or screened out: only the hash is known
            elif their.state not in OVER:
                found.append(second_submission(other, their))
                continue
        found += between(person, their, pay, site)
    known = {their.submission_id for their in theirs}
    missing = [p for p in ours if p.must_be_listed and p.submission_id and p.submission_id not in known]
    found += [unknown_there(person) for person in missing if site.lists_everybody]
    if not site.pays_in_parts:
        found = [without_return(each) for each in found]
    return [each for each in found if ledger.get(each.key) != "done"]


def without_return(found: Mismatch) -> Mismatch:
    """The same where what was handed in cannot be given back: nobody is asked for what they cannot do."""
    if found.action != "ask_return":
        return found
    says = f"{found.says}; what is handed in there cannot be given back, and is paid by itself in the end"
    return replace(found, key=key_of("look", found.submission_id), action="look", says=says)


def between(person: Ours | None, their: Theirs, pay: Pay | None, site: Site) -> Iterator[Mismatch]:
    """What is open between one person and one submission."""
    if person is None:
        yield from nobody_here(their)
    elif person.status == ACTIVE:
        yield from still_here(person, their)
    elif person.status in WENT_THROUGH:
        yield from through(person, their, pay)
    elif person.status == "screened_out":
        yield from screened_out(person, their, pay)
    elif person.status == "withdrawn":
        yield from withdrew(person, their, pay, site)
    elif person.status in {"declined", "timed_out", "returned", "rejected"}:
        yield from gone(person, their)


def nobody_here(their: Theirs) -> Iterator[Mismatch]:
    if their.state == "awaiting_review":
        yield mismatch(None, their, "ask_return", "handed in there, but never started here")
    elif their.state in PAID:
        yield mismatch(None, their, "look", "paid there, but never started here")


def still_here(person: Ours, their: Theirs) -> Iterator[Mismatch]:
    if their.state in GIVEN_BACK:
        yield mismatch(person, their, "follow", f"{words(their.state)} there, still active here")
    elif their.state == "awaiting_review":
        yield mismatch(person, their, "ask_return", "handed in there before the end here")
    elif their.state in OVER:
        yield mismatch(person, their, "look", f"{words(their.state)} there, still active here")


def through(person: Ours, their: Theirs, pay: Pay | None) -> Iterator[Mismatch]:
    state = their.state
    if state in {"returned", "rejected", "timed_out", "screened_out"}:
        yield mismatch(person, their, "look", f"went through everything here, {words(state)} there")
        return
    if state in {"reserved", "active"}:
        return  # has not handed in yet: nothing is wrong
    if their.code and person.code and their.code != person.code:
        yield mismatch(person, their, "look", "handed in another code than was shown here")
        return
    if state == "awaiting_review":
        reward = pay.reward_minor if pay else 0
        yield mismatch(person, their, "approve", "went through everything, not yet paid", reward)
    if pay and person.bonus_minor:
        yield mismatch(person, their, "bonus", "has earned a bonus, not yet paid", person.bonus_minor)


def screened_out(person: Ours, their: Theirs, pay: Pay | None) -> Iterator[Mismatch]:
    if their.state in {"awaiting_review", "active", "reserved"}:
        amount = pay.screen_out_minor if pay else 0
        yield mismatch(person, their, "screen_out", "screened out here, still open there", amount)
    elif their.state in PAID:
        yield mismatch(person, their, "look", "screened out here, paid in full there")


def withdrew(person: Ours, their: Theirs, pay: Pay | None, site: Site) -> Iterator[Mismatch]:
    """Part of the reward; where only the whole can be paid, the whole, and nothing beside it."""
    if not site.pays_in_parts:
        if their.state == "awaiting_review":
            says = "withdrew here and handed in there, where only the whole reward can be paid"
            yield mismatch(person, their, "approve", says, pay.reward_minor if pay else 0)
        return
    if person.partial_minor and their.state != "rejected":
        yield mismatch(person, their, "partial", "withdrew here: partial pay is owed", person.partial_minor)
    if their.state in {"awaiting_review", "active"}:
        yield mismatch(person, their, "ask_return", "withdrawn here, still open there")


def gone(person: Ours, their: Theirs) -> Iterator[Mismatch]:
    if their.state in {"awaiting_review", "active"}:
        yield mismatch(person, their, "ask_return", f"{words(person.status)} here, still open there")
    elif their.state in PAID:
        yield mismatch(person, their, "look", f"{words(person.status)} here, paid there")


def second_submission(person: Ours, their: Theirs) -> Mismatch:
    says = "a second submission of a person who is here already"
    return mismatch(person, their, "ask_return", says)


def unknown_there(person: Ours) -> Mismatch:
    return Mismatch(
        key_of("look", person.submission_id),
        person.participant_id,
        person.submission_id,
        person.status,
        "unknown",
        "came from there, but is not in its list",
        "look",
    )


def mismatch(
    person: Ours | None, their: Theirs, action: ActionKind, says: str, amount_minor: int = 0
) -> Mismatch:
    return Mismatch(
        key_of(action, their.submission_id),
        person.participant_id if person else "",
        their.submission_id,
        person.status if person else "unknown",
        their.state,
        says,
        action,
        amount_minor,
    )


def words(state: str) -> str:
    return state.replace("_", " ")


class OverCapError(ValueError):
    """A payment that the study's caps do not allow; the message names the cap."""


def check_caps(pay: Pay | None, amount_minor: int, person_minor: int, study_minor: int) -> None:
    """See to it that a payment stays within both caps.

    Args:
        pay: of the study; None: nothing can be paid.
        amount_minor: what is to be paid now.
        person_minor: paid to, or on its way to, this person so far.
        study_minor: the same for everybody of the study.

    Raises:
        OverCapError: it does not.
    """
    if amount_minor == 0:
        return
    if pay is None:
        raise OverCapError("the study states no pay, so that nothing can be paid")
    if person_minor + amount_minor > pay.cap_participant_minor:
        raise OverCapError("the cap for one participant would be passed")
    if study_minor + amount_minor > pay.cap_study_minor:
        raise OverCapError("the cap for the study would be passed")
