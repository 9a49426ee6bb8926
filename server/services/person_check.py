"""What is stored about one participant, held against everything else that it follows from.

Arm, signs and seed follow from the draw, the draw from the secret key and from what it was told; which trials
there must be follows from the page, and a code from the study. What only the browser said (device text,
viewport) and when somebody was last seen follow from nothing and cannot be checked.
"""

from collections.abc import Iterator, Sequence

from server.domain import allocation, canonical, forms, plan
from server.domain.allocation import Allocated
from server.domain.participation import ACTIVE, ENDS, WENT_THROUGH, State
from server.domain.plan import COMPLETE, page_kind
from server.services import enrol
from server.services.journey import code_of
from server.services.lab import Lab
from server.services.session import Session
from server.storage import answers, enrolments, journeys, studies
from server.storage.database import DbSession
from server.storage.enrolments import AllocationRow
from server.storage.trials import TrialRow


def check(db: DbSession, lab: Lab, session: Session, rows: Sequence[TrialRow]) -> Iterator[str]:
    """One line for each difference; `rows` are the participant's trials in the order of their rounds.

    Raises:
        Exception: of any kind, where what is stored cannot even be read.
    """
    who = session.participant.id
    yield from (f"{who} {line}" for line in of_draw(db, lab, session))
    yield from (f"{who} {line}" for line in of_enrolment(db, lab, session))
    yield from (f"{who} {line}" for line in of_end(session, rows))
    yield from (f"{who} {line}" for line in of_answers(db, session))
    yield from (f"{who} {line}" for line in of_journey(db, session))
    for absent in absent_rounds(session, rows):
        yield f"{who}-{absent:03d} is missing, or has not ended: the participant went on after it"


def of_draw(db: DbSession, lab: Lab, session: Session) -> Iterator[str]:
    """The draw of the arm and of the signs, done again."""
    participant, drawn = session.participant, enrolments.allocation_of(db, session.participant.id)
    if drawn.seed != lab.seed(participant.id):
        yield f"allocation.seed stored {drawn.seed}, not this participant's under this secret key"
    device = device_of(session, drawn)
    cell = canonical.dumps([participant.arm, participant.role_order, device])
    if drawn.cell != cell:
        yield f"allocation.cell stored {drawn.cell}, the participant has {cell}"
    again = drawn_again(session, drawn)
    if again is None or (again.arm, again.role_order) != (participant.arm, participant.role_order):
        yield f"allocation: stored {participant.arm}, {participant.role_order}; the draw gives {again}"
        return
    if again.probability != drawn.probability:
        yield f"allocation.probability stored {drawn.probability}, replay {again.probability}"
    signs = enrol.sign_permutations(lab, session.study, participant.arm, drawn.seed)
    for name, replay in zip(("token_permutation", "number_permutation"), signs, strict=True):
        if (stored := getattr(participant, name)) != canonical.dumps(replay):
            yield f"{name} stored {stored}, replay {canonical.dumps(replay)}"


def drawn_again(session: Session, drawn: AllocationRow) -> Allocated | None:
    counts = {tuple(cell): people for *cell, people in canonical.loads(drawn.counts)}
    orders, device = session.study.role_orders, device_of(session, drawn)
    return allocation.allocate(enrol.places_of(session.study), orders, device, counts, drawn.seed)


def device_of(session: Session, drawn: AllocationRow) -> str:
    """The device class at the draw; of who had the data erased only the draw knows it."""
    if session.participant.erased_utc is None:
        return session.participant.device
    device: str = canonical.loads(drawn.cell)[2]
    return device


def of_enrolment(db: DbSession, lab: Lab, session: Session) -> Iterator[str]:
    """Key, study, identity and consent. A marketplace's id is never named."""
    participant = session.participant
    if participant.key_sha256 != canonical.sha256(lab.participant_key(participant.id)):
        yield "key_sha256 is not the one under this secret key"
    if participant.study_id != studies.version(db, participant.study_version_id).study_id:
        yield "study_id and study_version_id belong to two studies"
    who = enrolments.identity_of(db, participant.id)
    if (who.study_id, who.marketplace) != (participant.study_id, participant.marketplace):
        yield "identity is of another study or marketplace"
    if who.external_hash != lab.external_hash(who.marketplace, who.external_id):
        yield "identity.external_hash is not that of the id beside it"
    agreed, texts = enrolments.consent_of(db, participant.id), session.study.texts
    stored = (agreed.choice, agreed.version, agreed.text_sha256)
    if stored != (wanted := ("agreed", texts.consent_version, session.study.consent_sha256)):
        yield f"consent stored {stored}, the study has {wanted}"


def of_end(session: Session, rows: Sequence[TrialRow]) -> Iterator[str]:
    """Status, page, code and times belong together; a code is there only where nothing is missing."""
    participant = session.participant
    if participant.page not in session.plan.pages:
        yield f"page stored {participant.page!r}, the plan has none of that name"
    through = participant.page == COMPLETE
    absent = plan.missing(session.plan, [(row.round, row.outcome) for row in rows])
    state = State(participant.status) if participant.status in ENDS else None
    if participant.completion_code is not None and absent and state is None:
        yield f"has a completion code, but rounds {absent} have not ended"
        return
    if (state in WENT_THROUGH) != through or (state is None and participant.status != ACTIVE):
        yield f"status and completion code stored {participant.status}, on page {participant.page}"
    wanted = code_of(session.study, state) if state else None
    if participant.completion_code != wanted:
        stored = (participant.status, participant.completion_code)
        yield f"status and completion code stored {stored}, the study has {wanted}"
    last_utc = rows[-1].ended_utc if rows else None
    if (participant.finished_utc is not None) != through or (
        participant.finished_utc and last_utc and participant.finished_utc < last_utc
    ):
        yield f"finished_utc stored {participant.finished_utc}, on page {participant.page} since {last_utc}"
    if rows and rows[0].started_utc < participant.consented_utc:
        yield f"consented_utc stored {participant.consented_utc}, after the first trial began"


def of_answers(db: DbSession, session: Session) -> Iterator[str]:
    """Right answers are right, and whoever went through everything has handed in every form."""
    stored = answers.of_participant(db, session.participant.id)
    for row in stored:
        kind, _, number = row.form.partition(":")
        role = session.plan.of_block(int(number))[0].role if kind == "quiz" else "driver"
        question = forms.right_answers(session.study, row.form, role).get(row.item)
        if row.correct != (question.is_right(row.value) if question else None):
            yield f"answer {row.form} {row.item}: correct stored {row.correct}"
    if session.participant.page == COMPLETE:
        names = {row.form for row in stored}
        if missing := [name for name in plan.forms_of(session.study, session.plan) if name not in names]:
            yield f"answers to {missing} are missing"


def of_journey(db: DbSession, session: Session) -> Iterator[str]:
    """The last thing that is said to have happened led to where the participant is."""
    steps = journeys.of_participant(db, session.participant.id)
    if [step.seq for step in steps] != list(range(1, len(steps) + 1)):
        yield "journey: steps are missing"
    last = steps[-1].state if steps else None
    stored = session.participant.status
    if last is not None and (last in ENDS or stored != ACTIVE) and last != stored:
        yield f"status stored {stored}, the journey ends with {last}"


def absent_rounds(session: Session, rows: Sequence[TrialRow]) -> list[int]:
    """Rounds that the participant has been through, by the page or by a later round, and that did not end."""
    page = session.participant.page
    if page not in session.plan.pages or session.participant.erased_utc is not None:
        return []
    block = session.plan.blocks + 1 if page == COMPLETE else page_kind(page)[1] or session.plan.blocks + 1
    newest = max((row.round for row in rows), default=0)
    passed = {r.round for r in session.plan.rounds if r.block < block or r.round < newest}
    return sorted(passed - {row.round for row in rows if row.outcome is not None})
