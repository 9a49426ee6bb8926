"""Bonuses at Prolific, and what can be promised of them.

Prolific has no request token; it says of paying a bulk that the request is not idempotent and that the money
moves minutes after the answer. So `Bonuses`

- never sends the paying request twice by itself;
- looks at the bonuses that each submission has, and takes an equal amount for the payment itself;
- remembers, while it lives, what it sent or saw, because a payment shows late;
- raises `UncertainError` where an answer was lost.

A crash or a second process ends that memory. The caller therefore keeps a ledger: *proposed*; then *sent*,
committed before `pay`; then *done*, by what `pay` returns. What is *sent* after a crash or an UncertainError
is not sent again before `paid` was asked `SETTLED_S` later or more: an amount that is there by then was paid,
one that is not was not. Equal amounts on one submission can only be counted, so two rules hold for them: all
of them go into one call, those that were paid earlier too; and none is sent while another is *sent* and
undecided. One process at a time may pay.
"""

import threading
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from urllib.parse import quote

from server.recruitment.bonuses import by_request
from server.recruitment.prolific_http import Connection, LostError
from server.recruitment.prolific_lookup import sitting, sittings
from server.recruitment.prolific_wire import Bulk, decimal, read
from server.recruitment.recruiter import Bonus, Paid, RecruiterError, UncertainError

BULK_MAX = 200  # Prolific's own advice for one bulk
SETTLED_S = 3_600  # Prolific: "in the following minutes"; an hour leaves room
COST_MAX = 2.0  # fees and tax stay below the bonuses themselves; a larger cost means misread units
SEEN = "seen on the submission"
ONE_BULK = threading.Lock()  # Prolific does not take two at once


@dataclass(slots=True)
class Memory:
    """What was sent or seen: each request's bonus, and its bulk once Prolific said that it took it."""

    bonuses: dict[str, Bonus] = field(default_factory=dict)
    bulks: dict[str, str] = field(default_factory=dict)


class Bonuses:
    """The bonuses of one account."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._memory = Memory()

    def paid(self, posting_id: str) -> Mapping[str, tuple[int, ...]]:
        """Amounts that each submission was paid beside its reward; certain `SETTLED_S` after a payment.

        Asks for every submission by itself: lists do not tell bonuses.
        """
        everybody = sittings(self._connection, posting_id)
        return {each: sitting(self._connection, each).bonuses_minor for each in everybody}

    def pay(self, posting_id: str, bonuses: Sequence[Bonus]) -> Sequence[Paid]:
        """Pay in one bulk what was not paid yet.

        Raises:
            UncertainError: an answer was lost; all of them may have been paid, or none.
            RecruiterError: nothing was paid.
        """
        wanted = by_request(bonuses)
        with ONE_BULK:
            settled = self._settled(posting_id, wanted)
            due = {request: bonus for request, bonus in wanted.items() if request not in settled}
            if due:
                settled |= self._pay(posting_id, due)
        return [Paid(request, settled[request]) for request in wanted]

    def _settled(self, posting_id: str, wanted: Mapping[str, Bonus]) -> dict[str, str]:
        """References of those that were paid already.

        What was sent is matched first: a payment that is seen is that one's, not a later equal one's.
        """
        seen = self._seen(posting_id, wanted)
        settled: dict[str, str] = {}
        for request in sorted(wanted, key=lambda each: each not in self._memory.bonuses):
            bonus = wanted[request]
            if self._memory.bonuses.get(request, bonus) != bonus:
                raise RecruiterError(f"bonus {request} was sent with other contents: give it another name")
            if request in self._memory.bulks or seen[place(bonus)] > 0:
                seen[place(bonus)] -= 1
                settled[request] = self._memory.bulks.get(request, SEEN)
                self._remember(bonus, settled[request])
            elif request in self._memory.bonuses:
                raise UncertainError(
                    f"bonus {request} was sent and its answer lost: look before sending it again"
                )
        return settled

    def _seen(self, posting_id: str, wanted: Mapping[str, Bonus]) -> Counter[tuple[str, int]]:
        """How many bonuses of each amount the submissions have that are not known to be other requests'."""
        seen: Counter[tuple[str, int]] = Counter()
        for submission_id, external_id in {
            (each.submission_id, each.external_id) for each in wanted.values()
        }:
            found = sitting(self._connection, submission_id)
            if found.study_id != posting_id or found.participant not in {None, external_id}:
                raise RecruiterError(f"submission {submission_id} is another person's or another study's")
            seen.update((submission_id, amount) for amount in found.bonuses_minor)
        seen.subtract(
            place(bonus) for request, bonus in self._memory.bonuses.items() if request not in wanted
        )
        return seen

    def _pay(self, posting_id: str, due: Mapping[str, Bonus]) -> dict[str, str]:
        """Set up a bulk and pay it. The paying request leaves once, whatever comes back."""
        bulk = self._set_up(posting_id, due)
        self._memory.bonuses |= due
        try:
            self._connection.post(f"/bulk-bonus-payments/{quote(bulk.id, safe='')}/pay/", {})
        except LostError as lost:
            reason = str(lost)
        except RecruiterError:  # it was refused or never left: nothing was paid
            self._forget(due)
            raise
        else:
            paid = dict.fromkeys(due, bulk.id)
            self._memory.bulks |= paid
            return paid
        raise UncertainError(f"{reason} ({len(due)} bonuses)")

    def _remember(self, bonus: Bonus, reference: str) -> None:
        """Keep it, so that a payment that shows later is not taken for this one."""
        self._memory.bonuses[bonus.request] = bonus
        self._memory.bulks[bonus.request] = reference

    def _forget(self, due: Iterable[str]) -> None:
        for request in due:
            del self._memory.bonuses[request]

    def _set_up(self, posting_id: str, due: Mapping[str, Bonus]) -> Bulk:
        """Announce a bulk, which pays nothing, and check that Prolific understood the amounts."""
        if len(due) > BULK_MAX:
            raise RecruiterError(f"{len(due)} bonuses in one call: pay at most {BULK_MAX}")
        lines = (f"{each.submission_id},{decimal(each.amount_minor)}\n" for each in due.values())
        body = {"study_id": posting_id, "csv_bonuses": "".join(lines)}
        bulk = read(Bulk, self._connection.post("/submissions/bonus-payments/", body, repeatable=True))
        asked = sum(bonus.amount_minor for bonus in due.values())
        if not asked <= bulk.total_amount <= COST_MAX * asked:
            cost = f"{bulk.total_amount:.0f} instead of about {asked} minor units"
            raise RecruiterError(f"Prolific would take {cost}: nothing was paid, look at Prolific")
        return bulk


def place(bonus: Bonus) -> tuple[str, int]:
    """All that Prolific keeps of a bonus."""
    return bonus.submission_id, bonus.amount_minor
