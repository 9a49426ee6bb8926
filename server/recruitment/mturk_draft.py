"""What a study is at MTurk before it has a HIT: a qualification type that bears its name.

MTurk has no drafts and nothing is kept here, so the draft (places, entry address) stands in the description
of the qualification type that keeps people from taking the study twice. One draft per study: the last counts.
"""

import re
from dataclasses import dataclass

from server.recruitment.mturk_client import MTurkClient, RefusedError
from server.recruitment.recruiter import RecruiterError

NAME = "hatlab: took part in {slug}"
DESCRIPTION = "For everybody who took part in this study, which can be taken once. {places} places at {url}"
DRAFT = re.compile(r"(\d+) places at (\S+)$")
TAKEN = "AWS.MechanicalTurk.QualificationTypeAlreadyExists"


@dataclass(frozen=True, slots=True)
class Draft:
    places: int
    entry_url: str

    @property
    def description(self) -> str:
        return DESCRIPTION.format(places=self.places, url=self.entry_url)


def keep(client: MTurkClient, slug: str, draft: Draft) -> str:
    """Write the draft to the study's qualification type, made if it is not there; its id.

    Raises:
        RecruiterError: as the client; also where MTurk's search does not find it yet (again).
    """
    name = NAME.format(slug=slug)
    if found := find(client, name):
        return rewrite(client, found, draft)
    try:
        made = client.ask(
            "create_qualification_type",
            Name=name,
            Description=draft.description,
            QualificationTypeStatus="Active",
        )
    except RefusedError as error:
        if error.code != TAKEN:
            raise
        raise RecruiterError(
            f"MTurk has “{name}” but does not list it yet: try again in a minute", again=True
        ) from None
    return str(made["QualificationType"]["QualificationTypeId"])


def rewrite(client: MTurkClient, qualification: str, draft: Draft) -> str:
    client.ask("update_qualification_type", QualificationTypeId=qualification, Description=draft.description)
    return qualification


def find(client: MTurkClient, name: str) -> str | None:
    """The id of our own qualification type of exactly this name; the search is by words."""
    own = client.every(
        "list_qualification_types",
        "QualificationTypes",
        Query=name,
        MustBeRequestable=False,
        MustBeOwnedByCaller=True,
    )
    return next((str(each["QualificationTypeId"]) for each in own if each["Name"] == name), None)


def read(client: MTurkClient, qualification: str) -> Draft:
    """The draft as it was last written.

    Raises:
        RecruiterError: as the client; also where the description was changed by hand.
    """
    kind = client.ask("get_qualification_type", QualificationTypeId=qualification)["QualificationType"]
    found = DRAFT.search(kind["Description"])
    if found is None:
        raise RecruiterError(f"the description of “{kind['Name']}” at MTurk was changed: post it again")
    return Draft(int(found[1]), found[2])
