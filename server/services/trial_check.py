"""One stored trial, executed again: the first place where what is stored and what the replay gives differ.

Everything that follows from something else is computed again: the spec from study, participant and plan;
every state of the world from the recorded actions; what was seen from the recorded messages; tokens from
numbers; the row from the events; the digests from the bodies. What is only recorded (key presses, times, what
agents decided) is held by the digests and must be legal.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from models.policies.lexicon import Lexicon
from server.domain import canonical, events, trial
from server.domain.errors import CorruptError, HatlabError
from server.domain.events import Body
from server.domain.plan import Round
from server.domain.spec import TrialSpec
from server.domain.trial import Trial
from server.domain.view import saw
from server.ghost.translation import translate
from server.services import fold
from server.services.lab import Lab
from server.services.session import Session, spec_of
from server.storage.events import EventRow
from server.storage.trials import TrialRow

SAID_MAX = 200


class DifferenceError(Exception):
    """What is stored is not what the replay gives; says where."""


@dataclass
class Audit:
    """How often the agents, asked again, decide otherwise than recorded. Never makes a trial bad."""

    decided: int = 0
    otherwise: int = 0

    def compare(self, recorded: Sequence[object], again: Sequence[object]) -> None:
        self.decided += len(recorded)
        self.otherwise += sum(a != b for a, b in zip(recorded, again, strict=True))


def check(
    lab: Lab, session: Session, row: TrialRow, stored: Sequence[EventRow], audit: Audit | None = None
) -> str | None:
    """The first difference of a trial in one line, or None."""
    try:
        bodies = parsed(stored)
        spec = expected_spec(lab, session, row)
        after = replayed(lab, spec, stored, bodies)
        check_mode(session, bodies[0])
        check_row(expected_row(session, spec, after, stored, row), row)
        if audit is not None:
            decide_again(lab, spec, bodies, audit)
    except (DifferenceError, HatlabError) as error:
        return f"{row.id} {error}"
    except Exception as error:  # noqa: BLE001 (a row may hold anything; the others are still to be checked)
        return f"{row.id} cannot be replayed: {said_of(error)}"
    return None


def check_mode(session: Session, start: Body) -> None:
    """Data of a robot or a test stay what they were when the trial began."""
    if (mode := start["mode"]) != session.participant.mode:
        raise DifferenceError(f"seq 0: mode stored {mode}, the participant has {session.participant.mode}")


def parsed(stored: Sequence[EventRow]) -> list[Body]:
    bodies = []
    for seq, event in enumerate(stored):
        if event.seq != seq:
            raise DifferenceError(f"seq {seq}: missing")
        try:
            bodies.append(canonical.loads(event.body))
        except ValueError as error:
            raise DifferenceError(f"seq {seq}: body is not JSON") from error
    if not bodies:
        raise DifferenceError("seq 0: missing")
    return bodies


def planned_for(session: Session, row: TrialRow) -> Round:
    if not 1 <= row.round <= len(session.plan.rounds):
        raise DifferenceError(f"trial.round stored {row.round}, the plan has {len(session.plan.rounds)}")
    return session.plan.rounds[row.round - 1]


def expected_spec(lab: Lab, session: Session, row: TrialRow) -> TrialSpec:
    spec = spec_of(lab, session, planned_for(session, row))
    if spec.bundle is not None and row.bundle == spec.bundle.name and row.bundle_sha256 is not None:
        lab.agent(row.bundle, row.bundle_sha256)  # says so if another release of it is loaded
    return spec


def replayed(lab: Lab, spec: TrialSpec, stored: Sequence[EventRow], bodies: Sequence[Body]) -> Trial:
    """Go through the events, each against what it must be; the trial after the last."""
    _, lexicon = fold.crew_of(lab, spec)
    at, digest, before_utc = trial.start(spec), "", ""
    for seq, (event, body) in enumerate(zip(stored, bodies, strict=True)):
        try:
            at = started(at, body) if seq == 0 else decided(at, body)
            check_tokens(at, body, lexicon)
            seen = saw(at, translate(at, lexicon))
            again = rebuilt(body, event, seen.to_dict(), spec if seq == 0 else None)
        except (CorruptError, KeyError, TypeError, IndexError, AttributeError, ValueError) as error:
            raise DifferenceError(f"seq {seq}: {said_of(error)}") from error
        for found in differences(body, again):
            raise DifferenceError(f"seq {seq}: {found}")
        digest = events.digest(digest, event.body)
        check_envelope(seq, event, body, digest, before_utc)
        before_utc = event.stored_utc
    return at


def said_of(error: Exception) -> str:
    """An error in one line, never empty."""
    if isinstance(error, KeyError):
        return f"{error.args[0]!r} is missing"
    return " ".join(str(error).split())[:SAID_MAX] or type(error).__name__


def started(at: Trial, body: Mapping[str, Any]) -> Trial:
    said = events.said_in(body)
    if error := trial.speech_error(at, said):
        raise CorruptError(error)
    if at.spec.role == "child" and said != events.silence(at.env.agents):
        raise CorruptError("tokens: speech before the participant chose")
    return trial.spoken(at, said)


def decided(at: Trial, body: Mapping[str, Any]) -> Trial:
    after = trial.apply(at, body)
    if error := events.timing_error(body["timing"]):
        raise CorruptError(error)
    return after


def check_tokens(at: Trial, body: Mapping[str, Any], lexicon: Lexicon | None) -> None:
    """Messages exist in the bundle's codebook, or, in practice, on the panel."""
    panel = at.spec.condition.panel
    tokens = lexicon.tokens if lexicon else len(panel.positions) if panel else 0
    for said in (body, *body.get("moves", ())):
        for token in said.get("tokens", ()):
            if token >= tokens:
                raise CorruptError(f"tokens: {token} of {tokens}")


def rebuilt(body: Body, event: EventRow, seen: Mapping[str, Any], spec: TrialSpec | None) -> Body:
    """The body as it must be, given what it records: nothing more may stand in it, and nothing else."""
    again = {"saw": dict(seen), "stored_utc": event.stored_utc}
    if spec is not None:
        said = {"tokens": list(body["tokens"]), "gates": list(body["gates"])}
        whose = {"trial": event.trial_id, "mode": body["mode"]}
        return {"kind": "start", **whose, "spec": spec.model_dump(mode="json"), **said, **again}
    moves = [{name: list(move[name]) for name in ("actions", "tokens", "gates")} for move in body["moves"]]
    kept = {name: body[name] for name in ("action", "token", "timing")}
    return {"kind": "decision", **kept, "moves": moves, **again}


def differences(stored: Any, replay: Any, path: str = "") -> Iterator[str]:
    """Where two JSON values differ, like `saw.triangle_max stored 0.31, replay 0.42`."""
    if isinstance(stored, dict) and isinstance(replay, dict):
        for name in sorted(stored.keys() | replay.keys()):
            absent = "absent"
            yield from differences(stored.get(name, absent), replay.get(name, absent), f"{path}.{name}")
    elif isinstance(stored, list) and isinstance(replay, list) and len(stored) == len(replay):
        for index, (one, other) in enumerate(zip(stored, replay, strict=True)):
            yield from differences(one, other, f"{path}.{index}")
    elif stored != replay or isinstance(stored, bool) != isinstance(replay, bool):
        yield f"{path.removeprefix('.')} stored {stored}, replay {replay}"


def check_envelope(seq: int, event: EventRow, body: Body, digest: str, before_utc: str) -> None:
    if canonical.dumps(body) != event.body:
        raise DifferenceError(f"seq {seq}: body is not in canonical form")
    if digest != event.digest:
        raise DifferenceError(f"seq {seq}: digest does not belong to the body: one of them was changed")
    if event.stored_utc < before_utc:
        raise DifferenceError(f"seq {seq}: stored at {event.stored_utc}, before the event before it")


def expected_row(
    session: Session, spec: TrialSpec, after: Trial, stored: Sequence[EventRow], row: TrialRow
) -> TrialRow:
    planned, participant, last = planned_for(session, row), session.participant, stored[-1]
    return TrialRow(
        id=f"{participant.id}-{planned.round:03d}",
        participant_id=participant.id,
        round=planned.round,
        phase=planned.phase,
        block=planned.block,
        role=planned.role,
        number=planned.number,
        situation=planned.situation,
        arm=participant.arm,
        bundle=spec.bundle.name if spec.bundle else None,
        bundle_sha256=spec.bundle.sha256 if spec.bundle else None,
        seed=planned.seed,
        last_seq=last.seq,
        digest=last.digest,
        outcome=after.outcome,
        steps=after.step,
        progress=after.progress,
        started_utc=stored[0].stored_utc,
        ended_utc=last.stored_utc if after.over else None,
    )


def check_row(replay: TrialRow, stored: TrialRow) -> None:
    for name, again in replay._asdict().items():
        if (kept := getattr(stored, name)) != again:
            raise DifferenceError(f"trial.{name} stored {kept}, replay {again}")


def decide_again(lab: Lab, spec: TrialSpec, bodies: Sequence[Body], audit: Audit) -> None:
    """Let the agents decide again from what they were recorded to have heard."""
    running, said = fold.begin(lab, spec)
    audit.compare([*bodies[0]["tokens"], *bodies[0]["gates"]], [*said.tokens, *said.gates])
    running = replace(running, trial=trial.spoken(running.trial, events.said_in(bodies[0])))
    for body in bodies[1:]:
        running = fold.choose(running, body["token"])
        for move in events.moves_in(body):
            action = None if spec.role == "child" else body["action"]
            after, again = fold.step(running, action, recorded=move)
            audit.compare(
                [*move.actions, *move.said.tokens, *move.said.gates],
                [*again.actions, *again.said.tokens, *again.said.gates],
            )
            running = after
