"""What a requester may ask of the fake Mechanical Turk: the operations that hatlab uses, by MTurk's names.

Each takes the market and the request's JSON, and gives the answer's. Wordings and codes of refusals are
MTurk's as far as they are known (from its reference and from what people reported).
"""

import base64
import json
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Any
from xml.etree import ElementTree as ET

from server.recruitment import mturk_xml as xml
from server.simulate.mturk_market import Assignment, Hit, Market, Payment, Qualification, RequestError

Values = Mapping[str, Any]
Operation = Callable[[Market, Values], dict[str, Any]]

PAGE = 10
SMALL = 10
AUTO_APPROVAL_S = 2_592_000
HANDED_IN = ("Submitted", "Approved", "Rejected")
REVIEWED = ("Approved", "Rejected")


def create_hit_type(market: Market, values: Values) -> dict[str, Any]:
    for need in values.get("QualificationRequirements", ()):
        qualification(market, need["QualificationTypeId"])
    kind = {"AutoApprovalDelayInSeconds": AUTO_APPROVAL_S, **values}
    same = next((key for key, known in market.hit_types.items() if known == kind), None)
    key = same or market.new_id()
    market.hit_types[key] = kind
    return {"HITTypeId": key}


def create_hit_with_hit_type(market: Market, values: Values) -> dict[str, Any]:
    kind = values["HITTypeId"]
    if kind not in market.hit_types:
        raise RequestError("HITTypeDoesNotExist", f"HITType {kind} does not exist.")
    check_question(values.get("Question", ""))
    if not market.once(values.get("UniqueRequestToken")):
        same = next(hit for hit in market.hits.values() if hit.type_id == kind)
        raise RequestError("HITAlreadyExists", f"The HIT {same.id} already exists for this request token.")
    hit = Hit(
        id=market.new_id(),
        type_id=kind,
        group_id=market.new_id(),
        question=values["Question"],
        annotation=values.get("RequesterAnnotation", ""),
        places=values.get("MaxAssignments", 1),
        created=market.now(),
        expires=market.now() + timedelta(seconds=values["LifetimeInSeconds"]),
    )
    market.hits[hit.id] = hit
    return {"HIT": hit_json(market, hit)}


def get_hit(market: Market, values: Values) -> dict[str, Any]:
    return {"HIT": hit_json(market, hit_of(market, values))}


def list_hits(market: Market, values: Values) -> dict[str, Any]:
    return page("HITs", [hit_json(market, hit) for hit in market.hits.values()], values)


def list_hits_for_qualification_type(market: Market, values: Values) -> dict[str, Any]:
    wanted = qualification(market, values["QualificationTypeId"]).id
    found = [
        hit_json(market, hit)
        for hit in market.hits.values()
        if any(
            need["QualificationTypeId"] == wanted
            for need in market.type_of(hit).get("QualificationRequirements", ())
        )
    ]
    return page("HITs", found, values)


def update_expiration_for_hit(market: Market, values: Values) -> dict[str, Any]:
    hit, at = hit_of(market, values), datetime.fromtimestamp(values["ExpireAt"], UTC)
    refuse_repeated(market, f"{hit.id}{at:%a %b %d %H:%M:%S UTC %Y}")
    hit.expires = max(at, market.now())
    return {}


def create_additional_assignments_for_hit(market: Market, values: Values) -> dict[str, Any]:
    hit, more = hit_of(market, values), values["NumberOfAdditionalAssignments"]
    if hit.places < SMALL <= hit.places + more:
        raise RequestError(
            "InvalidMaximumAssignmentsIncrease",
            f"A HIT of fewer than {SMALL} assignments cannot be extended to {SMALL} or more.",
        )
    refuse_repeated(market, values.get("UniqueRequestToken"))
    hit.places += more
    return {}


def list_assignments_for_hit(market: Market, values: Values) -> dict[str, Any]:
    wanted = values.get("AssignmentStatuses") or HANDED_IN
    found = [
        assignment_json(each)
        for each in market.taken(hit_of(market, values))
        if each.status in wanted and visible(market, each)
    ]
    return page("Assignments", found, values)


def get_assignment(market: Market, values: Values) -> dict[str, Any]:
    found = assignment_of(market, values)
    if not visible(market, found):
        raise in_the_wrong_state("Reviewable,Approved,Rejected")
    return {"Assignment": assignment_json(found), "HIT": hit_json(market, market.hits[found.hit_id])}


def approve_assignment(market: Market, values: Values) -> dict[str, Any]:
    found = assignment_of(market, values)
    if not visible(market, found):
        raise in_the_wrong_state("null")
    override = found.status == "Rejected" and values.get("OverrideRejection")
    if found.status != "Submitted" and not override:
        raise in_the_wrong_state("Submitted")
    market.approve(found, values.get("RequesterFeedback", ""))
    return {}


def reject_assignment(market: Market, values: Values) -> dict[str, Any]:
    found = assignment_of(market, values)
    if found.status != "Submitted" or not visible(market, found):
        raise in_the_wrong_state("Submitted")
    found.status, found.decided = "Rejected", market.now()
    found.feedback = values["RequesterFeedback"]
    return {}


def send_bonus(market: Market, values: Values) -> dict[str, Any]:
    found, amount = assignment_of(market, values), Decimal(values["BonusAmount"])
    if found.worker != values["WorkerId"]:
        raise RequestError("InvalidParameterValue", "The worker did not work on this assignment.")
    if not visible(market, found):
        raise in_the_wrong_state("Submitted,Approved,Rejected")
    if amount <= 0:
        raise RequestError("InvalidParameterValue", f"{amount} is not a valid bonus amount.")
    market.must_afford(amount)
    refuse_repeated(market, values.get("UniqueRequestToken"))
    market.pay(Payment("bonus", found.worker, found.id, amount, values["Reason"], market.now()))
    return {}


def list_bonus_payments(market: Market, values: Values) -> dict[str, Any]:
    wanted, hit = values.get("AssignmentId"), values.get("HITId")
    found = [
        {
            "WorkerId": each.worker,
            "BonusAmount": str(each.amount),
            "AssignmentId": each.assignment,
            "Reason": each.reason,
            "GrantTime": each.at.timestamp(),
        }
        for each in market.ledger
        if each.kind == "bonus"
        and wanted in {None, each.assignment}
        and hit in {None, market.assignments[each.assignment].hit_id}
    ]
    return page("BonusPayments", found, values)


def get_account_balance(market: Market, _values: Values) -> dict[str, Any]:
    return {"AvailableBalance": f"{market.balance:.2f}"}


def notify_workers(market: Market, values: Values) -> dict[str, Any]:
    failures = []
    for worker in values["WorkerIds"]:
        known = any(each.worker == worker and each.status in REVIEWED for each in market.assignments.values())
        if known:
            market.messages.append(
                {"worker": worker, "subject": values["Subject"], "text": values["MessageText"]}
            )
        else:
            failures.append(
                {
                    "NotifyWorkersFailureCode": "HardFailure",
                    "NotifyWorkersFailureMessage": "You have not reviewed any work of this Worker.",
                    "WorkerId": worker,
                }
            )
    return {"NotifyWorkersFailureStatuses": failures}


def create_qualification_type(market: Market, values: Values) -> dict[str, Any]:
    if any(each.name == values["Name"] for each in market.qualifications.values()):
        raise RequestError(
            "QualificationTypeAlreadyExists", "You have already created a QualificationType with this name."
        )
    made = Qualification(market.new_id(), values["Name"], values["Description"], market.now())
    market.qualifications[made.id] = made
    return {"QualificationType": qualification_json(made)}


def get_qualification_type(market: Market, values: Values) -> dict[str, Any]:
    return {"QualificationType": qualification_json(qualification(market, values["QualificationTypeId"]))}


def update_qualification_type(market: Market, values: Values) -> dict[str, Any]:
    found = qualification(market, values["QualificationTypeId"])
    found.description = values.get("Description", found.description)
    return {"QualificationType": qualification_json(found)}


def list_qualification_types(market: Market, values: Values) -> dict[str, Any]:
    words = values.get("Query", "").lower().split()
    found = [
        qualification_json(each)
        for each in market.qualifications.values()
        if all(word in f"{each.name} {each.description}".lower() for word in words)
    ]
    return page("QualificationTypes", found, values)


def associate_qualification_with_worker(market: Market, values: Values) -> dict[str, Any]:
    qualification(market, values["QualificationTypeId"]).holders.add(values["WorkerId"])
    return {}


OPERATIONS: dict[str, Operation] = {
    "ApproveAssignment": approve_assignment,
    "AssociateQualificationWithWorker": associate_qualification_with_worker,
    "CreateAdditionalAssignmentsForHIT": create_additional_assignments_for_hit,
    "CreateHITType": create_hit_type,
    "CreateHITWithHITType": create_hit_with_hit_type,
    "CreateQualificationType": create_qualification_type,
    "GetAccountBalance": get_account_balance,
    "GetAssignment": get_assignment,
    "GetHIT": get_hit,
    "GetQualificationType": get_qualification_type,
    "ListAssignmentsForHIT": list_assignments_for_hit,
    "ListBonusPayments": list_bonus_payments,
    "ListHITs": list_hits,
    "ListHITsForQualificationType": list_hits_for_qualification_type,
    "ListQualificationTypes": list_qualification_types,
    "NotifyWorkers": notify_workers,
    "RejectAssignment": reject_assignment,
    "SendBonus": send_bonus,
    "UpdateExpirationForHIT": update_expiration_for_hit,
    "UpdateQualificationType": update_qualification_type,
}


def page(member: str, entries: Iterable[dict[str, Any]], values: Values) -> dict[str, Any]:
    """One page of a list. Its mark is only good for the same list."""
    everything, size = list(entries), values.get("MaxResults", PAGE)
    start = 0
    if mark := values.get("NextToken"):
        try:
            of, start = json.loads(base64.b64decode(mark))
        except ValueError:
            of = ""
        if of != member:
            raise RequestError("InvalidParameterValue", "The NextToken is not of this list.")
    shown = everything[start : start + size]
    answer: dict[str, Any] = {member: shown, "NumResults": len(shown)}
    if start + size < len(everything):
        answer["NextToken"] = base64.b64encode(json.dumps([member, start + size]).encode()).decode()
    return answer


def refuse_repeated(market: Market, token: str | None) -> None:
    if not market.once(token):
        raise RequestError("DuplicateRequest", f'The idempotency token "{token}" has already been processed.')


def check_question(question: str) -> None:
    """Refuse what is no external question."""
    try:
        root = ET.fromstring(question)  # noqa: S314 (expat bounds what entities become, and this is a fake)
    except ET.ParseError as error:
        raise RequestError("XMLParseError", f"There was an error parsing the XML question: {error}") from None
    if root.tag != f"{{{xml.QUESTION}}}ExternalQuestion" or not root.findtext(
        f"{{{xml.QUESTION}}}ExternalURL"
    ):
        raise RequestError("XMLParseError", "The fake takes an ExternalQuestion with an ExternalURL.")


def hit_of(market: Market, values: Values) -> Hit:
    found = market.hits.get(values["HITId"])
    if found is None:
        raise RequestError("HITDoesNotExist", f"Hit {values['HITId']} does not exist.")
    return found


def assignment_of(market: Market, values: Values) -> Assignment:
    found = market.assignments.get(values["AssignmentId"])
    if found is None:
        raise RequestError("AssignmentDoesNotExist", f"Assignment {values['AssignmentId']} does not exist.")
    return found


def qualification(market: Market, key: str) -> Qualification:
    found = market.qualifications.get(key)
    if found is None:
        raise RequestError("QualificationTypeDoesNotExist", f"QualificationType {key} does not exist.")
    return found


def visible(market: Market, assignment: Assignment) -> bool:
    """Whether the requester's side sees yet that it was handed in."""
    return (
        assignment.status in HANDED_IN and assignment.shows is not None and assignment.shows <= market.now()
    )


def in_the_wrong_state(wanted: str) -> RequestError:
    return RequestError("InvalidAssignmentState", f"This operation can be called with a status of: {wanted}")


def hit_json(market: Market, hit: Hit) -> dict[str, Any]:
    taken = market.taken(hit)
    counts = {status: sum(each.status == status for each in taken) for status in ("Accepted", *REVIEWED)}
    return {
        **market.type_of(hit),
        "HITId": hit.id,
        "HITTypeId": hit.type_id,
        "HITGroupId": hit.group_id,
        "HITStatus": market.status(hit),
        "HITReviewStatus": "NotReviewed",
        "Question": hit.question,
        "RequesterAnnotation": hit.annotation,
        "MaxAssignments": hit.places,
        "CreationTime": hit.created.timestamp(),
        "Expiration": hit.expires.timestamp(),
        "NumberOfAssignmentsAvailable": hit.places - len(taken),
        "NumberOfAssignmentsPending": counts["Accepted"],
        "NumberOfAssignmentsCompleted": counts["Approved"] + counts["Rejected"],
    }


def assignment_json(each: Assignment) -> dict[str, Any]:
    assert each.submitted is not None
    told = {
        "AssignmentId": each.id,
        "WorkerId": each.worker,
        "HITId": each.hit_id,
        "AssignmentStatus": each.status,
        "AcceptTime": each.accepted.timestamp(),
        "SubmitTime": each.submitted.timestamp(),
        "Deadline": each.deadline.timestamp(),
        "Answer": each.answer,
    }
    if each.decided is not None:
        kind = "ApprovalTime" if each.status == "Approved" else "RejectionTime"
        told |= {kind: each.decided.timestamp(), "RequesterFeedback": each.feedback}
    return told


def qualification_json(each: Qualification) -> dict[str, Any]:
    return {
        "QualificationTypeId": each.id,
        "Name": each.name,
        "Description": each.description,
        "CreationTime": each.created.timestamp(),
        "QualificationTypeStatus": "Active",
        "IsRequestable": True,
    }
