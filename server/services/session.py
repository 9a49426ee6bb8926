"""A participant's session as the services see it: the study that was consented to, and its rounds."""

from dataclasses import dataclass

from models.envs import registry
from server.domain import canonical, plan, study
from server.domain.plan import Plan, Round
from server.domain.spec import BundleName, Condition, Panel, SeatHolder, Start, TrialSpec
from server.domain.study import Arm, StudyDefinition
from server.domain.view import Place
from server.ghost import panel
from server.services.lab import Lab
from server.storage import enrolments, studies
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow

SEEKER, NOBODY = "scripted:seeker", "scripted:always-gas"


@dataclass(frozen=True)
class Session:
    participant: ParticipantRow
    study: StudyDefinition
    plan: Plan

    @property
    def arm(self) -> Arm:
        return self.study.arm(self.participant.arm)


def session_of(db: DbSession, lab: Lab, participant: ParticipantRow) -> Session:
    definition = definition_of(db, lab, participant.study_version_id)
    seed = enrolments.allocation_of(db, participant.id).seed
    return Session(participant, definition, plan.plan(definition, participant.role_order, seed))


def definition_of(db: DbSession, lab: Lab, version_id: int) -> StudyDefinition:
    """A launched version; it never changes, so that a process need read it only once."""
    known: StudyDefinition | None = lab.definitions.get(version_id)
    if known is None:
        known = study.from_json(studies.version(db, version_id).definition)
        lab.definitions.put(version_id, known)
    return known


def place_of(planned: Round) -> Place:
    return Place(planned.round, planned.number, planned.of, planned.block, planned.last)


def spec_of(lab: Lab, session: Session, planned: Round) -> TrialSpec:
    """What this participant plays in this round.

    Raises:
        NotReadyError: an agent that the study names is not loaded.
    """
    practice = planned.phase == "practice"
    agent = lab.agent(session.arm.bundle)
    return TrialSpec(
        task=session.study.environment,
        task_version=registry.make(session.study.environment).version,
        seed=planned.seed,
        start=start_of(planned),
        role=planned.role,
        phase=planned.phase,
        bundle=None if practice else BundleName(name=agent.name, sha256=agent.sha256),
        scripted=script_of(planned) if practice else None,
        seats=seats_of(session, planned),
        condition=condition_of(lab, session, planned),
    )


def start_of(planned: Round) -> Start:
    if planned.role != "driver":
        return "init"
    return "alone" if planned.phase == "practice" else "human"


def script_of(planned: Round) -> str:
    """Practice: a parent that seeks without hearing anything; on the road nobody else drives."""
    return NOBODY if planned.role == "driver" else SEEKER


def seats_of(session: Session, planned: Round) -> tuple[SeatHolder, ...]:
    """The parent has the first seat, the child the second, a driver the last."""
    holders: list[SeatHolder] = ["scripted" if planned.phase == "practice" else "policy"]
    holders *= registry.make(session.study.environment).agents
    holders[0 if planned.role == "parent" else -1] = "human"
    return tuple(holders)


def condition_of(lab: Lab, session: Session, planned: Round) -> Condition:
    """What the round presents; practice is the same in every arm."""
    arm, definition = session.arm, session.study
    practice = planned.phase == "practice"
    return Condition(
        communication=None if practice else arm.communication,
        budget=None if practice else arm.budget,
        overlay=practice or arm.overlay,
        step_limit=definition.step_limit,
        arrival=0.0 if practice else definition.arrival,
        child_sees_parent=definition.child_sees_parent,
        panel=panel_of(lab, session, practice=practice),
        blank=practice and planned.role != "driver",
    )


def panel_of(lab: Lab, session: Session, *, practice: bool) -> Panel | None:
    if session.study.panel_bundle is None:
        return None
    numbers = canonical.loads(session.participant.number_permutation)
    places = canonical.loads(session.participant.token_permutation)
    return panel.panel(
        lab.agent(session.study.panel_bundle), range(len(places)) if practice else places, numbers
    )
