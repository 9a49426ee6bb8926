"""Made-up people with real trials, written straight into a database: fast material for exports.

Worlds, events, digests and rows are the real ones (`server.domain`); only the people are drawn: what they do,
how long they take, and what the others say. The trials of a few people are played and then given to many.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, NamedTuple

import numpy as np
from sqlalchemy import insert

from models.envs import registry
from models.envs.grid import STAY
from models.envs.parent_child import CHILD
from models.vocabulary import SILENT
from server.domain import canonical, events, plan, trial, view
from server.domain.events import Body, Move, Said
from server.domain.plan import Round
from server.domain.spec import BundleName, Condition, Panel, TrialSpec
from server.domain.study import StudyDefinition, from_json
from server.domain.trial import Trial
from server.domain.view import Heard
from server.services.lab import Lab
from server.simulate.timing import Stopwatch
from server.storage import enrolments, participants, studies
from server.storage.database import DbSession
from server.storage.enrolments import AllocationRow, ConsentRow, IdentityRow
from server.storage.events import EventRow
from server.storage.participants import ParticipantRow
from server.storage.tables import event as event_table
from server.storage.tables import trial as trial_table
from server.storage.trials import TrialRow

TOKENS = 9
PEOPLE_A_TRANSACTION = 100
STORED_UTC = "2026-01-02T03:04:05.678Z"
PANEL = Panel(
    bundle="made-up",
    sha256="0" * 64,
    positions=tuple((index / 10, (index * 7 % 10) / 10) for index in range(TOKENS)),
    position_of_token=(3, 1, 4, 0, 5, 8, 2, 6, 7),
    number_at_position=(2, 7, 1, 8, 3, 9, 4, 5, 6),
)


class Played(NamedTuple):
    """One finished trial: its round, its last state and its events."""

    round: Round
    trial: Trial
    bodies: tuple[Body, ...]


def spec_of(study: StudyDefinition, planned: Round) -> TrialSpec:
    """The spec of a main or practice round with a made-up bundle."""
    driver, practice = planned.role == "driver", planned.phase == "practice"
    env = registry.make(study.environment)
    seats = ["policy"] * env.agents
    seats[-1 if planned.role in {"driver", "child"} else 0] = "human"
    arm = study.arms[0]
    return TrialSpec(
        task=study.environment,
        task_version=env.version,
        seed=planned.seed,
        start=("alone" if practice else "human") if driver else "init",
        role=planned.role,
        phase=planned.phase,
        bundle=None if practice else BundleName(name=arm.bundle, sha256="1" * 64),
        scripted="seeker" if practice else None,
        seats=tuple(seats),
        condition=Condition(
            communication=None if practice else arm.communication,
            budget=None if practice else arm.budget,
            overlay=arm.overlay,
            step_limit=study.step_limit,
            arrival=study.arrival,
            child_sees_parent=study.child_sees_parent,
            panel=None if driver else PANEL,
            blank=practice,
        ),
    )


def play(spec: TrialSpec, planned: Round, random: Random) -> Played:
    """Play a trial at random, from its first event to its last."""
    stopwatch = Stopwatch(str(random.random()), planned.round)
    now = said(trial.start(spec), random)
    bodies = [events.start_body("synthetic", "live", spec, now.said, saw(now), STORED_UTC)]
    while not now.over:
        action = random.choice(now.choices)
        token = PANEL.token_of(action) if spec.role == "child" else None
        now, moves = decided(now, action, token, random)
        bodies.append(events.decision_body(action, token, stopwatch.decision(), moves, saw(now), STORED_UTC))
    return Played(planned, now, tuple(bodies))


def decided(now: Trial, action: int, token: int | None, random: Random) -> tuple[Trial, tuple[Move, ...]]:
    moves: list[Move] = []
    if token is not None:
        now = trial.chosen(now, token)
    while not now.over and (not moves or now.spec.role == "child"):
        actions = acts(now, action, random)
        now = said(trial.moved(now, actions), random)
        moves.append(Move(actions, now.said))
    return now, tuple(moves)


def acts(now: Trial, action: int, random: Random) -> tuple[int, ...]:
    if now.spec.role == "driver":
        alive = now.env.alive(now.world)[0].tolist()
        drawn = [int(random.random() < 0.3) if there else 0 for there in alive]
        drawn[now.spec.seat] = action
        return tuple(drawn)
    return (action if now.spec.role == "parent" else random.randrange(4), STAY)


def said(now: Trial, random: Random) -> Trial:
    if now.over or (now.spec.role == "child" and now.held is None):
        return now
    if now.held is not None:
        return trial.spoken(now, now.held)
    speaks = (now.env.alive(now.world)[0] & np.asarray(now.env.speaks)).tolist()
    if now.spec.role == "parent":
        speaks = [seat == CHILD for seat in range(now.env.agents)]
    tokens = tuple(random.randrange(TOKENS) if there else SILENT for there in speaks)
    gates = tuple(there and (now.env.message_held or random.random() < 0.7) for there in speaks)
    return trial.spoken(now, Said(tokens, gates))


def saw(now: Trial) -> events.Saw:
    heard = sum(gate for seat, gate in enumerate(now.said.gates) if seat != now.spec.seat)
    token = now.token if now.spec.role == "child" else now.said.tokens[CHILD]
    sign = PANEL.number_of(token) if now.spec.condition.panel and token not in {None, SILENT} else None
    shown = Heard(messages=heard, drawn=heard, sign=sign, overlay=now.spec.role == "driver")
    return view.saw(now, shown)


@dataclass(frozen=True, slots=True)
class Person:
    """A made-up participant and the trials that they finished."""

    role_order: str
    played: tuple[Played, ...]


def person(study: StudyDefinition, seed: int) -> Person:
    """Let a made-up person play the whole session."""
    random = Random(seed)
    role_order = study.role_orders[seed % len(study.role_orders)]
    planned = plan.plan(study, role_order, seed)
    return Person(role_order, tuple(play(spec_of(study, each), each, random) for each in planned.rounds))


def fill(lab: Lab, slug: str, people: int, *, models: int = 8, first: int = 0, **changes: Any) -> int:
    """Give a study finished participants; return the number of their main decisions.

    `models` people are played; the others repeat them under their own ids. `changes` go into every
    participant's row (mode, status …).
    """
    with lab.database.reading() as db:
        study_id, version_id, study = definition(db, slug)
    played = [person(study, seed) for seed in range(min(models, people))]
    logs = [[logged(study, each) for each in one.played] for one in played]
    steps = 0
    for start in range(first, first + people, PEOPLE_A_TRANSACTION):
        with lab.database.writing() as db:
            for index in range(start, min(start + PEOPLE_A_TRANSACTION, first + people)):
                which = index % len(played)
                row = participant_row(study, study_id, version_id, index, played[which].role_order)
                steps += store(db, row._replace(**changes), study, logs[which])
    return steps


def definition(db: DbSession, slug: str) -> tuple[int, int, StudyDefinition]:
    row = studies.by_slug(db, slug)
    assert row is not None
    version = studies.newest_version(db, row.id)
    assert version is not None
    return row.id, version.id, from_json(version.definition)


def logged(study: StudyDefinition, played: Played) -> tuple[TrialRow, list[EventRow]]:
    """Make the rows of one trial, under the name of nobody."""
    rows, digest = [], ""
    for seq, body in enumerate(played.bodies):
        text = canonical.dumps(body)
        digest = events.digest(digest, text)
        rows.append(EventRow("", seq, text, digest, STORED_UTC))
    planned, spec = played.round, played.trial.spec
    row = TrialRow(
        id="",
        participant_id="",
        round=planned.round,
        phase=planned.phase,
        block=planned.block,
        role=planned.role,
        number=planned.number,
        situation=planned.situation,
        arm=study.arms[0].name,
        bundle=spec.bundle.name if spec.bundle else None,
        bundle_sha256=spec.bundle.sha256 if spec.bundle else None,
        seed=planned.seed,
        last_seq=len(rows) - 1,
        digest=digest,
        outcome=played.trial.outcome,
        steps=played.trial.step,
        progress=played.trial.progress,
        started_utc=STORED_UTC,
        ended_utc=STORED_UTC,
    )
    return row, rows


def participant_row(
    study: StudyDefinition, study_id: int, version_id: int, index: int, role_order: str
) -> ParticipantRow:
    signs = study.task == "parent_child"
    return ParticipantRow(
        id=f"P{index:010d}",
        study_id=study_id,
        study_version_id=version_id,
        mode="live",
        key_sha256=canonical.sha256(f"{study.slug}/{index}"),
        marketplace="prolific",
        arm=study.arms[0].name,
        role_order=role_order,
        token_permutation=canonical.dumps(PANEL.position_of_token if signs else []),
        number_permutation=canonical.dumps(PANEL.number_at_position if signs else []),
        device="desktop",
        browser="made-up",
        viewport="1280x720",
        status="finished",
        page="complete",
        consented_utc=STORED_UTC,
        last_seen_utc=STORED_UTC,
        finished_utc=STORED_UTC,
        completion_code=study.completion_code,
    )


def store(
    db: DbSession,
    row: ParticipantRow,
    study: StudyDefinition,
    logs: Sequence[tuple[TrialRow, Sequence[EventRow]]],
) -> int:
    """Write one person with everything that belongs to them; return the number of main decisions."""
    outside = f"marketplace-{row.id}"
    participants.add(db, row)
    enrolments.add(
        db,
        IdentityRow(row.id, row.study_id, row.marketplace, outside, canonical.sha256(outside), None, "{}"),
        ConsentRow(row.id, study.consent_sha256, study.texts.consent_version, "agree", STORED_UTC),
        AllocationRow(row.id, "{}", row.arm, 0.5, 7, STORED_UTC),
    )
    own = [(each._replace(id=f"{row.id}-{each.round:03d}", participant_id=row.id), log) for each, log in logs]
    db.write(insert(trial_table), [each._asdict() for each, _ in own])
    rows = [event._replace(trial_id=each.id)._asdict() for each, log in own for event in log]
    db.write(insert(event_table), rows)
    return sum(each.last_seq for each, _ in own if each.phase == "main")
