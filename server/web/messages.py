"""What is told in the states that have no page of their own: each says what to do next."""

from server.domain.study import StudyDefinition
from server.services.enrol import EntryKind
from server.web.pages import Action, MessagePage

CONTACT = "If you think that this is a mistake, write to {contact}."


def of_entry(kind: EntryKind, study: StudyDefinition) -> MessagePage:
    """What is told to somebody whom the study cannot take."""
    if kind == "preview":
        return preview(study.title)
    told = {"full": full, "paused": paused, "closed": closed, "not_invited": not_invited}
    return told[kind](study.title, study.contact)


def front_door() -> MessagePage:
    return MessagePage(
        "hatlab",
        "This is a hatlab server",
        (
            "If you were invited to a study, open the link from your invitation.",
            "If you run studies here, sign in.",
        ),
        "info",
        Action("Sign in", "/admin"),
    )


def unknown_study() -> MessagePage:
    return MessagePage(
        "No study here",
        "There is no study at this address",
        ("Check the link: it may have been cut off. Open the one from your invitation again.",),
        "warn",
    )


def unknown_session() -> MessagePage:
    return MessagePage(
        "No session here",
        "This link does not lead to a session",
        (
            "It may have been cut off when it was copied.",
            "Open the link from your invitation again; it brings you back to where you were.",
        ),
        "warn",
    )


def preview(title: str) -> MessagePage:
    return MessagePage(
        title,
        "This is a preview",
        (
            "Accept the task on the site that brought you here; the study then starts in this place.",
            "Nothing is recorded in a preview.",
        ),
        "info",
    )


def full(title: str, contact: str) -> MessagePage:
    return MessagePage(
        title,
        "All places are taken",
        (
            "Thank you for your interest. Enough people take part already. Nothing about you has been kept.",
            "If a recruitment site sent you, return your place there; that has no consequences for you.",
            CONTACT.format(contact=contact),
        ),
        "info",
    )


def paused(title: str, contact: str) -> MessagePage:
    return MessagePage(
        title,
        "This study is paused",
        (
            "Nobody can start at the moment. Open the same link again later.",
            "If you have started already, use the same browser and the same link as then.",
            CONTACT.format(contact=contact),
        ),
        "wait",
    )


def closed(title: str, contact: str) -> MessagePage:
    return MessagePage(
        title,
        "This study has ended",
        (
            "Thank you for your interest. No more people are needed, and nothing about you has been kept.",
            "If a recruitment site sent you, return your place there.",
            CONTACT.format(contact=contact),
        ),
        "info",
    )


def not_invited(title: str, contact: str) -> MessagePage:
    return MessagePage(
        title,
        "This invitation is not valid",
        (
            "The link is not one that this study sent out. It may have been cut off or changed on its way.",
            "Open the link from your invitation again, or copy the whole of it into the address line.",
            CONTACT.format(contact=contact),
        ),
        "warn",
    )
