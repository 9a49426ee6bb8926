"""The two XML documents of an external question: what a HIT shows, and what came back.

Source: the ExternalQuestion and QuestionFormAnswers articles of the MTurk API reference.
"""

from xml.etree import ElementTree as ET
from xml.sax.saxutils import escape

SCHEMAS = "http://mechanicalturk.amazonaws.com/AWSMechanicalTurkDataSchemas"
QUESTION = f"{SCHEMAS}/2006-07-14/ExternalQuestion.xsd"
ANSWERS = f"{{{SCHEMAS}/2005-10-01/QuestionFormAnswers.xsd}}"
CODE = "code"
"""Name of the field in which the exit form hands the completion code in."""


def external_question(url: str, height_px: int) -> str:
    """The question of a HIT that shows `url` in a frame; a height of 0 fills the window."""
    return (
        f'<ExternalQuestion xmlns="{QUESTION}"><ExternalURL>{escape(url)}</ExternalURL>'
        f"<FrameHeight>{height_px}</FrameHeight></ExternalQuestion>"
    )


def code_of(answer: str) -> str:
    """The completion code in a worker's answer; empty where there is none, or no such document.

    A document type could define entities, and MTurk sends none: such a document is not read.
    """
    if "<!DOCTYPE" in answer or "<!ENTITY" in answer:
        return ""
    try:
        root = ET.fromstring(answer)  # noqa: S314 entities need a document type, which was refused above
    except ET.ParseError:
        return ""
    for each in root.iter(f"{ANSWERS}Answer"):
        if each.findtext(f"{ANSWERS}QuestionIdentifier") == CODE:
            return (each.findtext(f"{ANSWERS}FreeText") or "").strip()
    return ""
