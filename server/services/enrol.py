"""Coming in: what an entry link leads to, consent, and the draw of the arm in the transaction that ends it.

One person per (study, marketplace, id), also when two tabs consent at once. A preview leaves no data; of who
declined or was screened out stay a keyed hash, the status and the date. A person who is in stays in: pausing
and closing stop newcomers only.
"""

import base64
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

from itsdangerous import BadSignature, TimestampSigner

from server.domain import allocation, canonical, plan
from server.domain.allocation import Allocated
from server.domain.errors import BadInputError, NotFoundError
from server.domain.participation import Event, State
from server.domain.study import StudyDefinition
from server.ghost import panel
from server.recruitment import personal, recognition
from server.recruitment.arrival import Arrival
from server.services import journey, lease
from server.services.lab import Lab
from server.services.pages import Page, advance, page_of
from server.services.session import definition_of, session_of
from server.storage import enrolments, journeys, participants, refusals, studies
from server.storage.database import DbSession
from server.storage.enrolments import AllocationRow, ConsentRow, IdentityRow
from server.storage.participants import ParticipantRow
from server.storage.refusals import RefusalRow
from server.storage.studies import StudyRow, VersionRow

__all__ = [
    "DeviceReport",
    "Enrolled",
    "Entry",
    "Page",
    "Refused",
    "advance",
    "consent",
    "entry",
    "page_of",
    "participant_by_key",
]

VISIT = "visit"
"""Parameter of direct links.

A random name for one visit to the entry page, so that a form sent twice makes one person.
"""
VISIT_BYTES = 16
TEXT = "consent_text"
"""Hidden field: the hash of the text that was read. What is stored as agreed to is what stood there."""
ROBOT_SIGNATURE_MAX_S = 3_600
DEVICES = ("desktop", "tablet", "phone")
UNKNOWN = "unknown"
TEXT_MAX = 120

EntryKind = Literal[
    "consent",
    "resume",
    "preview",
    "full",
    "paused",
    "closed",
    "declined",
    "screened_out",
    "not_invited",
    "not_found",
]
Refusal = Literal["declined", "screened_out"]
Mode = Literal["live", "test", "robot"]


@dataclass(frozen=True, slots=True)
class Entry:
    """What an entry link leads to."""

    kind: EntryKind
    study: StudyDefinition | None = None
    key: str | None = None
    """Of the session to go on with (`resume`)."""
    identifiers: Mapping[str, str] = field(default_factory=dict)
    """Hidden fields of the consent form."""


@dataclass(frozen=True, slots=True)
class DeviceReport:
    """What the browser says about itself; empty without scripts."""

    device: str = ""
    """Device class: desktop, tablet or phone."""
    browser: str = ""
    viewport: str = ""

    @property
    def device_class(self) -> str:
        return self.device if self.device in DEVICES else UNKNOWN


@dataclass(frozen=True, slots=True)
class Enrolled:
    key: str


@dataclass(frozen=True, slots=True)
class Refused:
    """Somebody declined, or cannot take part with this device.

    Of a person whom a marketplace named, the keyed hash, the status and the date were kept; else nothing.
    """

    study: StudyDefinition
    status: Refusal


@dataclass(frozen=True, slots=True)
class Visit:
    """A study as somebody stands before it."""

    row: StudyRow
    version: VersionRow
    study: StudyDefinition
    arrival: Arrival
    mode: Mode


def entry(db: DbSession, lab: Lab, slug: str, params: Mapping[str, str], robot: str | None = None) -> Entry:
    """What this link leads to. Writes nothing.

    Raises:
        BadInputError: `robot` is not the server's own signature of the study's name.
    """
    row = studies.by_slug(db, slug)
    visit = visit_of(db, lab, row, params, robot) if row else None
    if visit is None:
        return Entry("not_found")
    if known := known_key(db, lab, visit):
        return Entry("resume", visit.study, known)
    return Entry(kind_of(db, lab, visit), visit.study, identifiers=identifiers_of(visit))


def consent(
    db: DbSession,
    lab: Lab,
    slug: str,
    params: Mapping[str, str],
    *,
    agree: bool,
    device: DeviceReport,
    robot: str | None = None,
) -> Enrolled | Refused | Entry:
    """End consent: take the person in and draw the arm, or keep nothing.

    An `Entry` comes back where the study cannot take the person after all, and (of kind `consent`) where a
    new version has another text than the one that was read.

    Raises:
        NotFoundError: no such study.
        BadInputError: as in `entry`.
    """
    row = studies.by_slug(db, slug)
    if row is not None:
        row = studies.hold(db, row.id)  # who enrols next must see whom we count now
    visit = visit_of(db, lab, row, params, robot) if row else None
    if visit is None:
        raise NotFoundError(f"there is no study {slug}")
    if known := known_key(db, lab, visit):
        return Enrolled(known)
    if not agree:
        return refuse(db, lab, visit, "declined")
    if (kind := kind_of(db, lab, visit)) != "consent":
        return Entry(kind, visit.study)
    if params.get(TEXT, visit.study.consent_sha256) != visit.study.consent_sha256:
        return Entry("consent", visit.study, identifiers=identifiers_of(visit))
    return enrol(db, lab, visit, device)


def screen_out(
    db: DbSession, lab: Lab, slug: str, params: Mapping[str, str], robot: str | None = None
) -> Refused | Enrolled | Entry:
    """The device cannot do what the study needs, as the browser itself says. Whoever is in stays in.

    Raises:
        NotFoundError: no such study.
        BadInputError: as in `entry`.
    """
    row = studies.by_slug(db, slug)
    visit = visit_of(db, lab, studies.hold(db, row.id), params, robot) if row else None
    if visit is None:
        raise NotFoundError(f"there is no study {slug}")
    if known := known_key(db, lab, visit):
        return Enrolled(known)
    if visit.arrival.preview:
        return Entry("preview", visit.study)
    return refuse(db, lab, visit, "screened_out")


def refuse(db: DbSession, lab: Lab, visit: Visit, status: Refusal) -> Refused | Entry:
    """Keep that somebody does not take part. The first refusal of a person stands."""
    hashed = hash_of(lab, visit)
    if hashed is None:
        return Refused(visit.study, status)
    on_date = lab.now_utc()[:10]
    kept = refusals.add(db, RefusalRow(visit.row.id, hashed, visit.mode, status, on_date))
    return Refused(visit.study, kind_of_refusal(kept))


def kind_of_refusal(kept: RefusalRow) -> Refusal:
    return "declined" if kept.status == "declined" else "screened_out"


def hash_of(lab: Lab, visit: Visit) -> str | None:
    """The keyed hash of the person's marketplace id; None for who came by a link that names nobody."""
    arrival = visit.arrival
    if arrival.external_id is None or arrival.marketplace == "direct":
        return None
    return lab.external_hash(arrival.marketplace, arrival.external_id)


def come_back(db: DbSession, lab: Lab, key: str, params: Mapping[str, str]) -> None:
    """Keep the submission under which somebody came back, while there is something left to do.

    Who returned a task and took it again must end the new one: MTurk takes no form for the old assignment.
    Whoever had returned or timed out goes on where they left, if a place is free.
    """
    participant, arrival = participant_by_key(db, lab, key), recognition.recognise(params)
    known = enrolments.identity_of(db, participant.id)
    if arrival.submission_id in {None, known.submission_id}:
        return
    studies.hold(db, participant.study_id)
    participant = participants.hold(db, participant.id)
    if participant.status in {"returned", "timed_out"} and lease.is_free(db, lab, participant):
        journey.happen(db, lab, session_of(db, lab, participant), Event.TOOK_AGAIN, arrival.marketplace)
        participant = participants.by_id(db, participant.id)
    if participant.status == "active":
        parameters = canonical.dumps(dict(arrival.parameters))
        enrolments.renew(db, participant.id, arrival.submission_id or "", parameters)


def participant_by_key(db: DbSession, lab: Lab, key: str) -> ParticipantRow:  # noqa: ARG001
    """The participant whose address this is.

    Raises:
        NotFoundError: nobody's.
    """
    found = participants.by_key(db, canonical.sha256(key))
    if found is None:
        raise NotFoundError("there is no session at this address")
    return found


def visit_of(
    db: DbSession, lab: Lab, row: StudyRow, params: Mapping[str, str], robot: str | None
) -> Visit | None:
    """None for a study that was never launched."""
    version = studies.newest_version(db, row.id)
    if version is None or row.status == "draft":
        return None
    mode: Mode = "live" if row.mode == "live" else "test"
    if robot is not None:
        check_robot(lab, row.slug, robot)
        mode = "robot"
    return Visit(row, version, definition_of(db, lab, version.id), arrival_of(lab, row.slug, params), mode)


def check_robot(lab: Lab, slug: str, signature: str) -> None:
    signer = TimestampSigner(lab.secret_key, salt="robot")
    try:
        signed = signer.unsign(signature, max_age=ROBOT_SIGNATURE_MAX_S).decode()
    except BadSignature as error:
        raise BadInputError("X-Hatlab-Robot: not signed by this server's key") from error
    if signed != slug:
        raise BadInputError("X-Hatlab-Robot: signed for another study")


def recognised(lab: Lab, slug: str, params: Mapping[str, str]) -> Arrival:
    """Who arrives by this link, a person of the lab's own list by name; a direct one has none."""
    return recognition.recognise(params, partial(personal.name_of, slug=slug, key=lab.secret_key))


def arrival_of(lab: Lab, slug: str, params: Mapping[str, str]) -> Arrival:
    """The marketplace's arrival; a direct one is named after its visit, which no marketplace names."""
    arrival = recognised(lab, slug, params)
    if arrival.external_id is not None or arrival.preview or arrival.forged:
        return arrival
    visit = params.get(VISIT, "")
    return Arrival(arrival.marketplace, visit if is_visit(visit) else None)


def is_visit(text: str) -> bool:
    try:
        return len(base64.urlsafe_b64decode(text + "==")) == VISIT_BYTES
    except ValueError:
        return False


def identifiers_of(visit: Visit) -> dict[str, str]:
    arrival, read = visit.arrival, {TEXT: visit.study.consent_sha256}
    if arrival.external_id is not None and arrival.parameters:
        return {**arrival.parameters, **read}
    return {VISIT: secrets.token_urlsafe(VISIT_BYTES), **read}


def known_key(db: DbSession, lab: Lab, visit: Visit) -> str | None:
    """The key of the session that this person has already begun."""
    arrival = visit.arrival
    if arrival.external_id is None:
        return None
    hashed = lab.external_hash(arrival.marketplace, arrival.external_id)
    participant_id = enrolments.participant_of(db, visit.row.id, arrival.marketplace, hashed)
    return lab.participant_key(participant_id) if participant_id else None


def kind_of(db: DbSession, lab: Lab, visit: Visit) -> EntryKind:
    if visit.arrival.forged:
        return "not_invited"
    if (kept := refusal_of(db, lab, visit)) is not None:
        return kind_of_refusal(kept)
    if visit.row.status in {"paused", "closed"}:
        return "paused" if visit.row.status == "paused" else "closed"
    if visit.arrival.preview:
        return "preview"
    if not visit.study.agents <= lab.bundles.keys():
        return "paused"  # whoever was let in now would be stuck in the first round with a missing agent
    counts = counts_of(db, lab, visit)
    places = places_of(visit.study)
    return "consent" if allocation.open_cells(places, visit.study.role_orders, counts) else "full"


def refusal_of(db: DbSession, lab: Lab, visit: Visit) -> RefusalRow | None:
    hashed = hash_of(lab, visit)
    return refusals.of(db, visit.row.id, hashed) if hashed else None


def counts_of(db: DbSession, lab: Lab, visit: Visit) -> dict[tuple[str, str, str], int]:
    """Who holds a place, among people of the same mode: robots never mix with people."""
    leases = lease.began(db, lab, visit.row.id)
    cells = participants.holding_places(db, visit.row.id, visit.mode, leases)
    return {(cell.arm, cell.role_order, cell.device): cell.people for cell in cells}


def places_of(study: StudyDefinition) -> dict[str, int]:
    return {arm.name: arm.places for arm in study.arms}


def enrol(db: DbSession, lab: Lab, visit: Visit, device: DeviceReport) -> Enrolled | Entry:
    """Draw the arm and write everything that consent begins."""
    participant_id = new_id()
    seed = lab.seed(participant_id)
    counts = counts_of(db, lab, visit)
    places, orders = places_of(visit.study), visit.study.role_orders
    drawn = allocation.allocate(places, orders, device.device_class, counts, seed)
    if drawn is None:
        return Entry("full", visit.study)
    now_utc = lab.now_utc()
    key = lab.participant_key(participant_id)
    participants.add(db, participant_row(lab, visit, device, participant_id, seed, drawn))
    enrolments.add(
        db,
        identity_row(lab, visit, participant_id),
        ConsentRow(
            participant_id, visit.study.consent_sha256, visit.study.texts.consent_version, "agreed", now_utc
        ),
        AllocationRow(
            participant_id,
            canonical.dumps([[*cell, people] for cell, people in sorted(counts.items())]),
            canonical.dumps([drawn.arm, drawn.role_order, device.device_class]),
            drawn.probability,
            seed,
            now_utc,
        ),
    )
    journeys.add(db, participant_id, Event.AGREE, State.CONSENTED, journey.PARTICIPANT, now_utc)
    return Enrolled(key)


def participant_row(
    lab: Lab, visit: Visit, device: DeviceReport, participant_id: str, seed: int, drawn: Allocated
) -> ParticipantRow:
    places, numbers = sign_permutations(lab, visit.study, drawn.arm, seed)
    now_utc = lab.now_utc()
    return ParticipantRow(
        id=participant_id,
        study_id=visit.row.id,
        study_version_id=visit.version.id,
        mode=visit.mode,
        key_sha256=canonical.sha256(lab.participant_key(participant_id)),
        marketplace=visit.arrival.marketplace,
        arm=drawn.arm,
        role_order=drawn.role_order,
        token_permutation=canonical.dumps(places),
        number_permutation=canonical.dumps(numbers),
        device=device.device_class,
        browser=device.browser[:TEXT_MAX],
        viewport=device.viewport[:TEXT_MAX],
        status="active",
        page=plan.plan(visit.study, drawn.role_order, seed).pages[0],
        consented_utc=now_utc,
        last_seen_utc=now_utc,
        finished_utc=None,
        completion_code=None,
    )


def sign_permutations(lab: Lab, study: StudyDefinition, arm: str, seed: int) -> tuple[list[int], list[int]]:
    """Position of each token, and number at each position; empty where the study has no panel."""
    if study.panel_bundle is None:
        return [], []
    tokens = lab.agent(study.panel_bundle).lexicon.tokens
    communication = study.arm(arm).communication
    return panel.token_places(communication, seed, tokens), panel.position_numbers(seed, tokens)


def identity_row(lab: Lab, visit: Visit, participant_id: str) -> IdentityRow:
    """Nobody's own name is known of a direct visitor: it is the visit's, or drawn here."""
    arrival = visit.arrival
    external_id = arrival.external_id or secrets.token_urlsafe(VISIT_BYTES)
    return IdentityRow(
        participant_id=participant_id,
        study_id=visit.row.id,
        marketplace=arrival.marketplace,
        external_id=external_id,
        external_hash=lab.external_hash(arrival.marketplace, external_id),
        submission_id=arrival.submission_id,
        parameters=canonical.dumps(dict(arrival.parameters)),
    )


def new_id() -> str:
    """P and 10 characters of base32: 50 random bits."""
    return "P" + base64.b32encode(secrets.token_bytes(7)).decode()[:10]
