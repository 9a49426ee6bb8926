"""A Mechanical Turk in memory: HITs, assignments, qualifications, money, and a clock that can be moved.

This is the state and the worker's side; what a requester asks is in `mturk_operations`. Chance (ids, how long
an assignment takes to show) follows from the seed. Nothing is kept when the process ends.
"""

import random
import string
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Any, Literal
from xml.etree import ElementTree as ET

from server.recruitment import mturk_xml as xml

ID_LETTERS = string.ascii_uppercase + string.digits
ID_LENGTH = 30
BALANCE = Decimal("10000.00")  # what every sandbox account has
FEE = Decimal("0.20")
TOKEN_LIFE = timedelta(days=1)
AssignmentStatus = Literal["Accepted", "Submitted", "Approved", "Rejected", "Returned", "Abandoned"]
TAKEN = frozenset({"Accepted", "Submitted", "Approved", "Rejected"})


class RequestError(Exception):
    """A request that MTurk refuses; `code` is one of its own."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = f"AWS.MechanicalTurk.{code}"


class WorkerError(Exception):
    """Something that the worker site does not let a worker do; the message is for the worker."""


@dataclass(slots=True)
class Hit:
    id: str
    type_id: str
    group_id: str
    question: str
    annotation: str
    places: int
    created: datetime
    expires: datetime

    @property
    def url(self) -> str:
        """What the frame shows."""
        return self._of_question("ExternalURL")

    @property
    def frame_px(self) -> int:
        return int(self._of_question("FrameHeight") or 0)

    def _of_question(self, name: str) -> str:
        root = ET.fromstring(self.question)  # noqa: S314 it was read when the HIT was made
        return root.findtext(f"{{{xml.QUESTION}}}{name}") or ""


@dataclass(slots=True)
class Assignment:
    id: str
    hit_id: str
    worker: str
    accepted: datetime
    deadline: datetime
    status: AssignmentStatus = "Accepted"
    submitted: datetime | None = None
    shows: datetime | None = None
    """When the requester's side begins to see that it was submitted."""
    decided: datetime | None = None
    answer: str = ""
    feedback: str = ""


@dataclass(slots=True)
class Qualification:
    id: str
    name: str
    description: str
    created: datetime
    holders: set[str] = field(default_factory=set)


@dataclass(frozen=True, slots=True)
class Payment:
    """One line of the ledger."""

    kind: Literal["reward", "bonus"]
    worker: str
    assignment: str
    amount: Decimal
    reason: str
    at: datetime


class Market:
    """The whole marketplace. `delay_s`: an assignment takes up to so long to show to the requester."""

    def __init__(
        self, seed: int = 0, delay_s: float = 0.0, clock: Callable[[], datetime] = lambda: datetime.now(UTC)
    ) -> None:
        self.seed, self.delay_s, self._clock = seed, delay_s, clock
        self.clear()

    def clear(self) -> None:
        """Begin again: nothing is posted, no time was skipped, and chance is as it was at first."""
        self._chance = random.Random(self.seed)  # noqa: S311 a fake, and it must be repeatable
        self._shift = timedelta()
        self.balance = BALANCE
        self.hit_types: dict[str, dict[str, Any]] = {}
        self.hits: dict[str, Hit] = {}
        self.assignments: dict[str, Assignment] = {}
        self.qualifications: dict[str, Qualification] = {}
        self.ledger: list[Payment] = []
        self.messages: list[dict[str, str]] = []
        self._tokens: dict[str, datetime] = {}

    def now(self) -> datetime:
        return self._clock() + self._shift

    def forward(self, seconds: float) -> None:
        """Let time pass."""
        self._shift += timedelta(seconds=seconds)
        self.settle()

    def new_id(self, first: str = "3") -> str:
        return first + "".join(self._chance.choices(ID_LETTERS, k=ID_LENGTH - 1))

    def settle(self) -> None:
        """What time alone does: assignments run out, and what nobody reviewed is approved."""
        for each in self.assignments.values():
            if each.status == "Accepted" and each.deadline <= self.now():
                each.status = "Abandoned"
            if each.status == "Submitted" and each.submitted:
                delay = self.type_of(self.hits[each.hit_id])["AutoApprovalDelayInSeconds"]
                if each.submitted + timedelta(seconds=delay) <= self.now():
                    self.approve(each)

    def once(self, token: str | None) -> bool:
        """Whether this is the first request with the token; MTurk forgets tokens after a day."""
        if token is None:
            return True
        first = self._tokens.get(token)
        if first is not None and self.now() - first < TOKEN_LIFE:
            return False
        self._tokens[token] = self.now()
        return True

    def type_of(self, hit: Hit) -> dict[str, Any]:
        return self.hit_types[hit.type_id]

    def taken(self, hit: Hit) -> list[Assignment]:
        """Assignments that hold a place."""
        return [each for each in self.assignments.values() if each.hit_id == hit.id and each.status in TAKEN]

    def expired(self, hit: Hit) -> bool:
        return hit.expires <= self.now()

    def status(self, hit: Hit) -> str:
        taken = self.taken(hit)
        full = len(taken) >= hit.places
        working = any(each.status == "Accepted" for each in taken)
        if (full or self.expired(hit)) and not working:
            return "Reviewable"
        return "Unassignable" if full or self.expired(hit) else "Assignable"

    def must_afford(self, amount: Decimal) -> None:
        """See whether there is enough for the amount and the fee.

        Raises:
            RequestError: there is not.
        """
        if amount * (1 + FEE) > self.balance:
            raise RequestError("InsufficientFunds", "This Requester has insufficient funds in their account")

    def pay(self, payment: Payment) -> None:
        """Move money, with the fee; may raise as `must_afford`."""
        self.must_afford(payment.amount)
        self.balance -= payment.amount * (1 + FEE)
        self.ledger.append(payment)

    def approve(self, assignment: Assignment, feedback: str = "") -> None:
        reward = Decimal(self.type_of(self.hits[assignment.hit_id])["Reward"])
        self.pay(Payment("reward", assignment.worker, assignment.id, reward, feedback, self.now()))
        assignment.status, assignment.decided, assignment.feedback = "Approved", self.now(), feedback

    def offered(self, worker: str) -> list[Hit]:
        """HITs that this worker finds."""
        self.settle()
        return [
            hit
            for hit in self.hits.values()
            if self.status(hit) == "Assignable" and self.qualifies(worker, hit)
        ]

    def qualifies(self, worker: str, hit: Hit) -> bool:
        """Whether every requirement is met; the fake knows `Exists` and `DoesNotExist`."""
        for need in self.type_of(hit).get("QualificationRequirements", ()):
            holds = worker in self.qualifications[need["QualificationTypeId"]].holders
            if holds != (need["Comparator"] == "Exists"):
                return False
        return True

    def accept(self, worker: str, hit_id: str) -> Assignment:
        """Take a place.

        Raises:
            WorkerError: it is not this worker's to take.
        """
        self.settle()
        hit = self.hits.get(hit_id)
        if hit is None:
            raise WorkerError("There is no such HIT.")
        if any(each.worker == worker for each in self.taken(hit)):
            raise WorkerError("You have already accepted or completed this HIT.")
        if hit not in self.offered(worker):
            raise WorkerError("This HIT is no longer available to you.")
        lasts = timedelta(seconds=self.type_of(hit)["AssignmentDurationInSeconds"])
        made = Assignment(self.new_id(), hit_id, worker, self.now(), self.now() + lasts)
        self.assignments[made.id] = made
        return made

    def give_back(self, assignment_id: str) -> None:
        """Return a place.

        Raises:
            WorkerError: nobody holds it.
        """
        self.held(assignment_id).status = "Returned"

    def submit(self, assignment_id: str, fields: Mapping[str, str]) -> Assignment:
        """Hand in.

        Raises:
            WorkerError: nobody holds the assignment, its time is up, or there is nothing beside its id.
        """
        assignment = self.held(assignment_id)
        if not fields:
            raise WorkerError("The form must hold at least one field beside assignmentId.")
        assignment.status, assignment.submitted = "Submitted", self.now()
        assignment.shows = self.now() + timedelta(seconds=self._chance.uniform(0, self.delay_s))
        assignment.answer = answers(fields)
        return assignment

    def held(self, assignment_id: str) -> Assignment:
        self.settle()
        found = self.assignments.get(assignment_id)
        if found is None or found.status != "Accepted":
            raise WorkerError(
                "Nobody holds this assignment: it was handed in or returned, or its time is up."
            )
        return found


def answers(fields: Mapping[str, str]) -> str:
    """The form as MTurk hands it to the requester."""
    root = ET.Element("QuestionFormAnswers", xmlns=xml.ANSWERS.strip("{}"))
    for name, value in fields.items():
        answer = ET.SubElement(root, "Answer")
        ET.SubElement(answer, "QuestionIdentifier").text = name
        ET.SubElement(answer, "FreeText").text = value
    return ET.tostring(root, encoding="unicode", xml_declaration=True)
