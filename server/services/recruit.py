"""Recruiting: postings are made and steered, and what the marketplace tells is taken in.

What it tells moves people only where that frees a place (returned, timed out, rejected there); nothing here
costs money. The network is never waited for inside a transaction.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple, TypeVar

from server.domain import canonical
from server.domain.errors import BadInputError, HatlabError, NotFoundError
from server.domain.participation import Event
from server.domain.study import StudyDefinition
from server.recruitment.recruiter import Change, Posted, Posting, Recruiter, RecruiterError, Submission
from server.services import journey
from server.services.lab import Lab
from server.services.recruiters import recruiter
from server.services.session import definition_of, session_of
from server.services.studies import find
from server.storage import participants, postings, studies
from server.storage.database import DbSession
from server.storage.postings import PostingRow, SubmissionRow

T = TypeVar("T")
TIME_LIMIT_FACTOR = 4  # of the estimated duration: nobody is timed out for being slow
TOLD: dict[str, Event] = {
    "returned": Event.RETURN_TOLD,
    "timed_out": Event.TIME_OUT_TOLD,
    "rejected": Event.REJECTION_TOLD,
}
"""States of a submission that move a participant."""


class MarketplaceError(HatlabError):
    """The marketplace did not do it; what it said."""

    status = 502
    title = "The marketplace did not do it"


class Place(NamedTuple):
    """A posting with the study it belongs to."""

    row: PostingRow
    study: StudyDefinition
    mode: str
    """Of the study now: who enters next counts so."""
    slug: str


def create(lab: Lab, slug: str, marketplace: str, places: int, description: str) -> int:
    """Make a draft at the marketplace; the id of the posting.

    Raises:
        BadInputError: the study is not launched or states no pay, or the number of places cannot be.
        MarketplaceError: it was not made there.
    """
    with lab.database.reading() as db:
        study = find(db, slug)
    definition = study.definition
    if study.version is None or definition is None:
        raise BadInputError("This study was never launched. Launch it first.")
    if definition.pay is None:
        raise BadInputError("This study states no pay. Fill in the pay on its page, and launch it again.")
    if not 1 <= places <= definition.places:
        raise BadInputError(f"places: a number from 1 to {definition.places}, the places of the study")
    wanted = posting_of(lab, definition, places, description)
    with recruiter(lab, marketplace, definition) as there:
        posted = asked(lambda: there.create(wanted))
    content = canonical.dumps(
        {"mode": study.row.mode, "description": description, "reward_minor": wanted.reward_minor}
    )
    with lab.database.writing() as db:
        if known := postings.by_external_id(db, marketplace, posted.id):
            return known.id
        return postings.add(
            db, study.row.id, marketplace, posted.id, posted.state, posted.places, content, lab.now_utc()
        )


def posting_of(lab: Lab, study: StudyDefinition, places: int, description: str) -> Posting:
    pay = study.pay
    assert pay is not None
    codes = {"complete": study.completion_code, **study.codes.model_dump()}
    return Posting(
        slug=study.slug,
        title=study.title,
        description=description,
        entry_url=f"{lab.settings.public_url}/s/{study.slug}",
        places=places,
        duration_min=study.duration_min,
        time_limit_min=study.duration_min * TIME_LIMIT_FACTOR,
        reward_minor=pay.reward_minor,
        currency=pay.currency,
        codes={outcome: code for outcome, code in codes.items() if code},  # type: ignore[misc]
    )


def place_of(db: DbSession, lab: Lab, posting_id: int) -> Place:
    """A posting by its id.

    Raises:
        NotFoundError: there is none.
    """
    row = postings.by_id(db, posting_id)
    if row is None:
        raise NotFoundError("there is no such posting")
    owner = studies.by_id(db, row.study_id)
    version = studies.newest_version(db, owner.id)
    assert version is not None
    study = definition_of(db, lab, version.id)
    return Place(row, study, owner.mode, owner.slug)


def publish(lab: Lab, posting_id: int) -> None:
    """Start recruiting, or go on after a pause."""
    steer(lab, posting_id, "publish")


def pause(lab: Lab, posting_id: int) -> None:
    """Let nobody new in."""
    steer(lab, posting_id, "pause")


def set_places(lab: Lab, posting_id: int, places: int) -> None:
    """Offer so many places in all.

    Raises:
        BadInputError: fewer than before, or more than the study has.
    """
    place = opened(lab, posting_id)
    if not place.row.places <= places <= place.study.places:
        raise BadInputError(f"places: a number from {place.row.places} to {place.study.places}")
    with recruiter(lab, place.row.marketplace, place.study) as there:
        posted = asked(lambda: there.set_places(place.row.external_id, places))
    keep(lab, posting_id, posted)


def steer(lab: Lab, posting_id: int, verb: str) -> None:
    place = opened(lab, posting_id)
    with recruiter(lab, place.row.marketplace, place.study) as there:
        do = there.publish if verb == "publish" else there.pause
        posted = asked(lambda: do(place.row.external_id))
    keep(lab, posting_id, posted)


def opened(lab: Lab, posting_id: int) -> Place:
    with lab.database.reading() as db:
        return place_of(db, lab, posting_id)


def keep(lab: Lab, posting_id: int, posted: Posted) -> None:
    with lab.database.writing() as db:
        postings.told(db, posting_id, posted.state, posted.places)


def poll(lab: Lab, posting_id: int) -> int:
    """Ask for everything and take it in; how many submissions there are.

    Raises:
        MarketplaceError: it could not be asked; or everything was taken in, and it refused to keep somebody
            who is new from coming twice.
    """
    place = opened(lab, posting_id)
    with recruiter(lab, place.row.marketplace, place.study) as there:
        posted = asked(lambda: there.posted(place.row.external_id))
        found = asked(lambda: there.submissions(place.row.external_id))
        new = newcomers(lab, posting_id, found)
        with lab.database.writing() as db:
            postings.hold(db, posting_id)
            postings.told(db, posting_id, posted.state, posted.places)
            take_in(db, lab, place, found, "poll")
            postings.polled(db, posting_id, lab.now_utc())
        remember_all(there, place, new)
    return len(found)


def remember_all(there: Recruiter, place: Place, new: Sequence[Submission]) -> None:
    """Have the marketplace keep each of them from coming twice; one refusal stops none of the others."""
    refusals = []
    for each in new:
        try:
            asked(partial(there.remember, place.row.external_id, each.external_id))
        except MarketplaceError as refusal:
            refusals.append(refusal)
    if refusals:
        raise refusals[0]


def newcomers(lab: Lab, posting_id: int, told: Sequence[Submission]) -> list[Submission]:
    """Those whom nothing was told of before."""
    with lab.database.reading() as db:
        known = {row.id for row in postings.submissions(db, posting_id)}
    return [each for each in told if each.id not in known]


def take_change(lab: Lab, marketplace: str, change: Change) -> bool:
    """Take in what a webhook told; False if it was told before, or is of nobody here."""
    with lab.database.writing() as db:
        if not postings.is_new_event(db, marketplace, change.event_id, lab.now_utc()):
            return False
        row = postings.of_submission(db, marketplace, change.submission.id, change.posting_id)
        if row is None:
            return False
        postings.hold(db, row.id)
        take_in(db, lab, place_of(db, lab, row.id), [change.submission], "webhook")
    return True


def take_in(db: DbSession, lab: Lab, place: Place, told: Sequence[Submission], source: str) -> None:
    """Store what was told, and let people follow who gave a place back. The caller holds the posting.

    A webhook may come late or twice: where a submission is over already, an earlier state is not believed.
    """
    before = {row.id: row for row in postings.submissions(db, place.row.id)}
    rows = []
    for each in told:
        known = before.get(each.id)
        if source == "webhook" and known is not None and known.state in SETTLED and each.state not in SETTLED:
            continue
        hashed = lab.external_hash(place.row.marketplace, each.external_id)
        code = each.code or (known.code if known else "")
        bonus = max(each.bonus_minor, known.bonus_minor if known else 0)
        rows.append(
            SubmissionRow(place.row.id, each.id, hashed, each.state, code, bonus, source, lab.now_utc())
        )
    postings.keep_submissions(db, rows)
    for row in rows:
        follow(db, lab, place, row)


SETTLED = frozenset({"approved", "partially_approved", "rejected", "screened_out", "returned"})


def follow(db: DbSession, lab: Lab, place: Place, told: SubmissionRow) -> None:
    """Let the participant of a submission follow what became of it there, where that frees a place."""
    event = TOLD.get(told.state)
    if event is None:
        return
    who = postings.participant_of_submission(db, place.row.study_id, place.row.marketplace, told.id)
    if who is None:
        return
    participant = participants.hold(db, who)
    journey.happen(db, lab, session_of(db, lab, participant), event, place.row.marketplace)


def asked(request: Callable[[], T]) -> T:
    """What the marketplace answers; its refusal as an error of ours."""
    try:
        return request()
    except RecruiterError as error:
        raise MarketplaceError(str(error)) from error
