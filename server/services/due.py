"""Which form a participant's page shows now."""

from server.domain import canonical, forms
from server.domain.forms import Form
from server.domain.plan import page_kind
from server.services.session import Session
from server.storage import answers, trials
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow


def due_form(db: DbSession, session: Session) -> Form | None:
    """The form that is due; None where rounds or instructions are, or nothing."""
    participant, study = session.participant, session.study
    kind, block = page_kind(participant.page)
    if kind == "play":
        return attention_due(db, session)
    handed_in = answers.attempts(db, participant.id)
    if kind == "quiz":
        role = session.plan.of_block(block)[0].role
        return forms.quiz(study, role, block, handed_in.get(f"quiz:{block}", 0) + 1)
    if kind == "survey":
        open_ones = study.questionnaires_at("block" if block else "end")
        missing = (each for each in open_ones if f"{each.key}:{block}" not in handed_in)
        return next((forms.questionnaire(each, block) for each in missing), None)
    if kind == "probe":
        return None if "probe:0" in handed_in else forms.probe(numbers_of(participant))
    return None


def attention_due(db: DbSession, session: Session) -> Form | None:
    """Asked whenever a round begins: what can be told without the database is told without it."""
    if not session.study.attention:
        return None
    rows = trials.of_participant(db, session.participant.id)
    over = sum(row.phase == "main" and row.outcome is not None for row in rows)
    if over < min(check.after for check in session.study.attention):
        return None
    check = forms.check_due(session.study, over, list(answers.attempts(db, session.participant.id)))
    return forms.attention(check) if check else None


def numbers_of(participant: ParticipantRow) -> list[int]:
    """The numbers that stood on the participant's signs."""
    found: list[int] = canonical.loads(participant.number_permutation)
    return found
