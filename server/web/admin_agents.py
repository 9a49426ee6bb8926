"""Admin: the agents that the server has loaded, and those that it could not load."""

from fastapi import APIRouter, Depends
from starlette.responses import Response

from server.services import agents
from server.services.agents import AgentFacts
from server.services.studies import TASKS
from server.web.admin_access import CurrentVisitor, signed_in
from server.web.admin_frame import frame, minute
from server.web.admin_pages import AgentCard, AgentPage, AgentsPage
from server.web.dependencies import CurrentLab
from server.web.rendering import html

router = APIRouter(dependencies=[Depends(signed_in)])
CHANNELS = {"prototype": "Prototype", "one-hot": "One-hot", "continuous": "Continuous", "none": "None"}


@router.get("/admin/agents")
def list_agents(lab: CurrentLab, visitor: CurrentVisitor) -> Response:
    with lab.database.reading() as db:
        surround = frame(db, lab, visitor, "agents")
    cards = tuple(card(each) for each in agents.every(lab))
    return html(AgentsPage(surround, cards, lab.bundle_errors))


@router.get("/admin/agents/{folder}/{name}")
def show_agent(lab: CurrentLab, visitor: CurrentVisitor, folder: str, name: str) -> Response:
    bundle = agents.find(lab, f"{folder}/{name}")
    shape, tokens = agents.meanings(bundle)
    with lab.database.reading() as db:
        surround = frame(db, lab, visitor, "agents")
    found = agents.facts(bundle)
    page = AgentPage(
        frame=surround,
        agent=card(found),
        facts=(
            ("World", found.environment),
            ("Gate", found.gate),
            ("Environment steps trained", f"{found.steps_trained:,}"),
            ("Started from", found.warm_start),
            ("Seed", str(found.seed)),
            ("Source", found.git_commit[:12]),
            ("Released", minute(found.created)),
            ("Messages counted", f"{bundle.lexicon.samples:,}"),
        ),
        rows=shape[0],
        columns=shape[1],
        tokens=tokens,
    )
    return html(page)


def card(found: AgentFacts) -> AgentCard:
    return AgentCard(
        name=found.name,
        task=TASKS.get(found.environment.split("/")[0], found.environment),
        channel=CHANNELS.get(found.channel, found.channel),
        budget=f"{found.budget:g}",
        tokens=found.tokens,
        tokens_used=found.tokens_used,
        tokens_null=found.tokens_null,
        figures=found.headline,
        evaluation=found.evaluation,
        sha256=found.sha256,
        url=f"/admin/agents/{found.name}",
    )
