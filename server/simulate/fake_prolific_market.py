"""A marketplace that behaves like Prolific, in memory: its studies, places, submissions and payments.

It follows Prolific's documents where they say something, also where that is inconvenient: a bulk of bonuses
that is paid twice pays twice. What changes by itself (a place runs out, a study is published) has changed
when somebody looks. Whatever is drawn follows from the seed.
"""

import threading
import time
from collections.abc import Callable, Mapping
from random import Random
from typing import Any, Final

from server.simulate.fake_prolific_records import (
    Bulk,
    Kind,
    Payment,
    Refusal,
    Study,
    Submission,
    check_rejection,
    check_study,
    least_time_min,
    minor,
)

RESERVED_S = 600
SCREENABLE: Final = {"ACTIVE", "AWAITING REVIEW"}
HOLDING: Final = {"RESERVED", "ACTIVE", "AWAITING REVIEW", "APPROVED", "PARTIALLY APPROVED", "SCREENED OUT"}
STUDY_MOVES: Final[Mapping[tuple[str, str], str]] = {
    ("UNPUBLISHED", "PUBLISH"): "PUBLISHING",
    ("ACTIVE", "PAUSE"): "PAUSED",
    ("PAUSED", "START"): "ACTIVE",
    ("ACTIVE", "STOP"): "COMPLETED",
    ("PAUSED", "STOP"): "COMPLETED",
    ("AWAITING REVIEW", "STOP"): "COMPLETED",
}


class Market:
    """All of it. Methods may be called from several threads.

    Args:
        publishing_s: How long a study is PUBLISHING.
        submit_lag_s: How long a code that was handed in takes to arrive: an approval can come first.
        bonus_lag_s: How long a paid bonus takes to show on its submission.
        paying_s: How long the request that pays a bulk takes; a second one meanwhile is answered 429.
        on_change: Is told of every submission that changed its state.
    """

    def __init__(
        self,
        seed: int = 0,
        *,
        clock: Callable[[], float] = time.time,
        publishing_s: float = 0.0,
        submit_lag_s: float = 0.0,
        bonus_lag_s: float = 0.0,
        paying_s: float = 0.0,
        on_change: Callable[[Submission], None] = lambda _: None,
    ) -> None:
        self.studies: dict[str, Study] = {}
        self.submissions: dict[str, Submission] = {}
        self.bulks: dict[str, Bulk] = {}
        self.payments: list[Payment] = []
        self.on_change = on_change
        self._random = Random(seed)  # noqa: S311 (a simulation)
        self._clock = clock
        self._ahead_s = 0.0
        self._publishing_s = publishing_s
        self._submit_lag_s = submit_lag_s
        self._bonus_lag_s = bonus_lag_s
        self._paying_s = paying_s
        self._lock = threading.RLock()
        self._paying = threading.Lock()

    # Time

    def now_s(self) -> float:
        return self._clock() + self._ahead_s

    def advance(self, seconds: float) -> None:
        """Let time pass at once."""
        with self._lock:
            self._ahead_s += seconds
            self.settle()

    def settle(self) -> None:
        """Bring everything to where it stands by now."""
        with self._lock:
            for submission in self.submissions.values():
                self._settle_submission(submission)
            for study in self.studies.values():
                self._settle_study(study)

    def _settle_submission(self, submission: Submission) -> None:
        now_s = self.now_s()
        allowed_min = float(self.studies[submission.study_id].fields["maximum_allowed_time"])
        limit_s = {"RESERVED": RESERVED_S, "ACTIVE": 60 * allowed_min}.get(submission.status)
        if submission.handed_in and now_s >= submission.handed_in[0]:
            when_s, code = submission.handed_in
            submission.handed_in = None
            self._complete(submission, code, when_s)
        elif limit_s is not None and now_s >= submission.taken_s + limit_s:
            self._set(submission, "TIMED-OUT")

    def _settle_study(self, study: Study) -> None:
        if study.status == "PUBLISHING" and self.now_s() >= study.published_s + self._publishing_s:
            study.status = "ACTIVE"
        if study.stopped or study.status not in {"ACTIVE", "AWAITING REVIEW", "COMPLETED"}:
            return
        states = [each.status for each in self.of_study(study.id)]
        if self.taken(study.id) < study.places or {"RESERVED", "ACTIVE"} & set(states):
            study.status = "ACTIVE"
        else:
            study.status = "AWAITING REVIEW" if "AWAITING REVIEW" in states else "COMPLETED"

    # The researcher's side: studies

    def create_study(self, fields: Mapping[str, Any]) -> Study:
        with self._lock:
            check_study(fields)
            least = least_time_min(float(fields["estimated_completion_time"]))
            study = Study(self._new_id(), {"maximum_allowed_time": least, **fields})
            self.studies[study.id] = study
            return study

    def study(self, study_id: str) -> Study:
        with self._lock:
            self.settle()
            if study_id not in self.studies:
                raise Refusal(404, "Study not found", "Not found")
            return self.studies[study_id]

    def change_study(self, study_id: str, fields: Mapping[str, Any]) -> Study:
        """A published study may only get more places or another internal name."""
        with self._lock:
            study = self.study(study_id)
            if study.status != "UNPUBLISHED":
                wrong = set(fields) - {"internal_name", "total_available_places"}
                if wrong:
                    raise Refusal(400, {each: ["Not editable once published"] for each in sorted(wrong)})
                if fields.get("total_available_places", study.places) < study.places:
                    raise Refusal(400, {"total_available_places": ["Only increasing is allowed"]})
            changed = {**study.fields, **fields}
            check_study(changed)
            study.stopped = study.stopped and changed["total_available_places"] == study.places
            study.fields = changed
            self.settle()
            return study

    def move_study(self, study_id: str, action: str) -> Study:
        with self._lock:
            study = self.study(study_id)
            status = STUDY_MOVES.get((study.status, action))
            if status is None:
                raise Refusal(400, f"A study that is {study.status} does not allow the action {action}")
            study.status = status
            study.stopped = action == "STOP"
            study.published_s = self.now_s() if action == "PUBLISH" else study.published_s
            self.settle()
            return study

    def of_study(self, study_id: str) -> list[Submission]:
        """Oldest first."""
        with self._lock:
            return [each for each in self.submissions.values() if each.study_id == study_id]

    def taken(self, study_id: str) -> int:
        return sum(each.status in HOLDING for each in self.of_study(study_id))

    # The researcher's side: submissions

    def submission(self, submission_id: str) -> Submission:
        with self._lock:
            self.settle()
            if submission_id not in self.submissions:
                raise Refusal(404, "Submission not found", "Not found")
            return self.submissions[submission_id]

    def move_submission(self, submission_id: str, body: Mapping[str, Any]) -> Submission:
        """APPROVE or REJECT, from AWAITING REVIEW only; the same once more changes nothing."""
        with self._lock:
            submission = self.submission(submission_id)
            action = str(body.get("action"))
            after = {"APPROVE": "APPROVED", "REJECT": "REJECTED"}.get(action)
            if after is None:
                raise Refusal(400, {"action": [f"{action} is not a valid action here"]})
            if submission.status == after:
                return submission
            if submission.status != "AWAITING REVIEW":
                raise Refusal(400, f"A submission that is {submission.status} does not allow {action}")
            if action == "REJECT":
                check_rejection(body)
            else:
                self._approve(submission)
            self._set(submission, after)
            self.settle()
            return submission

    def request_return(self, submission_id: str, reasons: object) -> Submission:
        with self._lock:
            submission = self.submission(submission_id)
            if not isinstance(reasons, list) or not reasons:
                raise Refusal(400, {"request_return_reasons": ["This field is required"]})
            if submission.status not in {"ACTIVE", "AWAITING REVIEW", "RESERVED", "TIMED-OUT"}:
                raise Refusal(400, f"A submission that is {submission.status} cannot be returned")
            submission.return_requested_s = self.now_s()
            return submission

    def screen_out(self, study_id: str, body: Mapping[str, Any]) -> None:
        with self._lock:
            study = self.study(study_id)
            if not study.fields.get("is_custom_screening"):
                raise Refusal(400, "The study has no custom screening")
            asked = [self.submission(each) for each in body.get("submission_ids", ())]
            wrong = [each.id for each in asked if each.status not in SCREENABLE or each.study_id != study_id]
            if wrong or not asked:
                raise Refusal(400, {"submission_ids": [f"cannot be screened out: {wrong}"]})
            amount = minor(body.get("bonus_per_submission"))
            for submission in asked:
                self._pay(submission, "screen_out", amount)
                self._set(submission, "SCREENED OUT")
            if body.get("increase_places"):
                study.fields["total_available_places"] = study.places + len(asked)
            self.settle()

    # The researcher's side: bonuses

    def set_up_bulk(self, study_id: str, lines: str) -> Bulk:
        """Read the lines `id,amount`; an id is a submission's or a participant's of this study."""
        with self._lock:
            self.study(study_id)
            bulk = Bulk(self._new_id(), study_id)
            for line in filter(None, lines.splitlines()):
                name, _, amount = line.partition(",")
                bulk.amounts.append((self._who(study_id, name.strip()).id, minor(amount.strip())))
            if not bulk.amounts:
                raise Refusal(400, {"csv_bonuses": ["This field is required"]})
            self.bulks[bulk.id] = bulk
            return bulk

    def pay_bulk(self, bulk_id: str) -> None:
        """Pay all lines, as often as it is asked. One at a time."""
        if bulk_id not in self.bulks:
            raise Refusal(404, "Bulk bonus payment not found", "Not found")
        if not self._paying.acquire(blocking=False):
            raise Refusal(429, "Another payment is being made", "Too many requests")
        try:
            time.sleep(self._paying_s)
            with self._lock:
                for submission_id, amount in self.bulks[bulk_id].amounts:
                    self._pay(self.submissions[submission_id], "bonus", amount, bulk_id)
        finally:
            self._paying.release()

    def bonuses(self, submission_id: str) -> list[int]:
        """Amounts that show on the submission by now."""
        with self._lock:
            return [
                each.amount_minor
                for each in self.payments
                if each.submission_id == submission_id
                and each.kind == "bonus"
                and each.shown_s <= self.now_s()
            ]

    # The participant's side

    def take(self, study_id: str, participant_id: str | None = None) -> Submission:
        """Take a place: reserved for ten minutes, until the link is opened."""
        with self._lock:
            study = self.study(study_id)
            if study.status != "ACTIVE" or self.taken(study_id) >= study.places:
                raise Refusal(400, "There is no free place")
            participant_id = participant_id or self._new_id()
            if any(each.participant_id == participant_id for each in self.of_study(study_id)):
                raise Refusal(400, "This participant has taken part already")
            submission = Submission(self._new_id(), study_id, participant_id, self.now_s())
            self.submissions[submission.id] = submission
            self.on_change(submission)
            return submission

    def entry_url(self, submission: Submission) -> str:
        url = str(self.studies[submission.study_id].fields["external_study_url"])
        return (
            url.replace("{{%PROLIFIC_PID%}}", submission.participant_id)
            .replace("{{%STUDY_ID%}}", submission.study_id)
            .replace("{{%SESSION_ID%}}", submission.id)
        )

    def begin(self, submission_id: str) -> Submission:
        """Open the link."""
        return self._by_participant(submission_id, {"RESERVED", "ACTIVE"}, "ACTIVE")

    def hand_in(self, submission_id: str, code: str) -> Submission:
        """Hand in a code; without one Prolific notes NOCODE. It takes `submit_lag_s` to arrive."""
        with self._lock:
            submission = self._in_state(submission_id, {"RESERVED", "ACTIVE"})
            if submission.handed_in is None:
                submission.handed_in = self.now_s() + self._submit_lag_s, code or "NOCODE"
            self.settle()
            return submission

    def give_back(self, submission_id: str) -> Submission:
        return self._by_participant(submission_id, {"RESERVED", "ACTIVE", "AWAITING REVIEW"}, "RETURNED")

    def time_out(self, submission_id: str) -> Submission:
        return self._by_participant(submission_id, {"RESERVED", "ACTIVE"}, "TIMED-OUT")

    def _by_participant(self, submission_id: str, before: set[str], after: str) -> Submission:
        with self._lock:
            submission = self._in_state(submission_id, before)
            self._set(submission, after)
            self.settle()
            return submission

    def _in_state(self, submission_id: str, states: set[str]) -> Submission:
        submission = self.submission(submission_id)
        if submission.status not in states:
            raise Refusal(400, f"The submission is {submission.status}")
        return submission

    # Inside

    def _complete(self, submission: Submission, code: str, when_s: float) -> None:
        """A code arrived: do its actions. An unknown one is left to the researcher, as is no code."""
        submission.code = code
        submission.completed_s = when_s
        actions = self._actions(submission.study_id, code)
        if "REQUEST_RETURN" in actions:
            submission.return_requested_s = when_s
        if "AUTOMATICALLY_APPROVE" in actions:
            self._approve(submission)
            self._set(submission, "APPROVED")
        else:
            self._set(submission, "AWAITING REVIEW")

    def _actions(self, study_id: str, code: str) -> set[str]:
        codes = self.studies[study_id].fields["completion_codes"]
        return {action["action"] for each in codes if each["code"] == code for action in each["actions"]}

    def _approve(self, submission: Submission) -> None:
        self._pay(submission, "reward", int(self.studies[submission.study_id].fields["reward"]))

    def _pay(self, submission: Submission, kind: Kind, amount: int, bulk_id: str = "") -> None:
        shown_s = self.now_s() + (self._bonus_lag_s if kind == "bonus" else 0)
        self.payments.append(
            Payment(submission.id, submission.participant_id, kind, amount, shown_s, bulk_id)
        )

    def _set(self, submission: Submission, status: str) -> None:
        if submission.status != status:
            submission.status = status
            self.on_change(submission)

    def _who(self, study_id: str, name: str) -> Submission:
        for each in self.of_study(study_id):
            if name in {each.id, each.participant_id}:
                return each
        raise Refusal(400, f"These ids did not take part in the study: {name}")

    def _new_id(self) -> str:
        return f"{self._random.getrandbits(96):024x}"
