"""The flow of a study in words: the boxes of a CONSORT diagram, from the counts of `services.flow`."""

from collections.abc import Mapping, Sequence

from server.domain.flow import LOST, Stage
from server.services.flow import Counts, Flow
from server.web.admin_pages import FlowArm, FlowBox

LABELS: Mapping[Stage, str] = {
    Stage.DECLINED: "declined",
    Stage.SCREENED_OUT: "device did not fit",
    Stage.CONSENTED: "Consented, and allocated to an arm",
    Stage.QUIZ_FAILED: "screened out by the quiz",
    Stage.WITHDRAWN: "withdrew",
    Stage.TIMED_OUT: "timed out",
    Stage.RETURNED: "returned their place",
    Stage.REJECTED: "rejected by the marketplace",
    Stage.ABANDONED: "left without a word",
    Stage.IN_PROGRESS: "still taking part",
    Stage.ERASED: "erased, at their wish",
    Stage.FINISHED: "Went through everything",
    Stage.ATTENTION_FAILED: "failed the attention checks",
    Stage.ANALYSED: "Analysed",
}
REACHED = "Known to have opened the link"


def boxes(flow: Flow) -> tuple[FlowBox, ...]:
    """From the first page to the analysis; beside each box, who does not come to the next."""
    whole = flow.whole
    refused = (Stage.DECLINED, Stage.SCREENED_OUT)
    known = sum(whole[stage] or 0 for stage in (*refused, Stage.CONSENTED))
    return (
        FlowBox(REACHED, known, lost(whole, refused)),
        box(whole, Stage.CONSENTED, LOST),
        box(whole, Stage.FINISHED, (Stage.ATTENTION_FAILED,)),
        box(whole, Stage.ANALYSED, ()),
    )


def box(counts: Counts, stage: Stage, leaves: Sequence[Stage]) -> FlowBox:
    return FlowBox(LABELS[stage], counts[stage] or 0, lost(counts, leaves))


def lost(counts: Counts, stages: Sequence[Stage]) -> tuple[tuple[str, int], ...]:
    """Label and number of each stage; of stages that nobody came to only the first is named."""
    named = [(LABELS[stage], counts[stage] or 0) for stage in stages]
    return tuple(each for each in named if each[1]) or tuple(named[:1])


def arms(flow: Flow) -> tuple[FlowArm, ...]:
    """Per arm: allocated, went through, analysed."""
    return tuple(
        FlowArm(arm, counts[Stage.CONSENTED] or 0, counts[Stage.FINISHED] or 0, counts[Stage.ANALYSED] or 0)
        for arm, counts in flow.arms.items()
    )
