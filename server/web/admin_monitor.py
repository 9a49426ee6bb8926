"""Admin: how a study goes, and the download of its data."""

from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query
from fastapi.responses import StreamingResponse
from starlette.responses import Response

from server.services import monitor, studies
from server.services.export import stream_zip
from server.services.flow import flows
from server.services.monitor import MODES, SHOWS, ModeCounts
from server.web import admin_flow
from server.web.admin_access import CurrentVisitor, signed_in
from server.web.admin_frame import entry_links, frame, head
from server.web.admin_pages import Filter, MonitorPage
from server.web.dependencies import CurrentLab
from server.web.rendering import html

router = APIRouter(dependencies=[Depends(signed_in)])
Modes = Annotated[list[str], Query(alias="mode")]


@router.get("/admin/studies/{slug}/monitor")
def monitor_page(
    lab: CurrentLab, visitor: CurrentVisitor, slug: str, mode: str = "", show: str = "now"
) -> Response:
    with lab.database.reading() as db:
        study = studies.find(db, slug)
        progress = monitor.counts(db, lab, study)
        chosen = mode if mode in MODES else study.row.mode
        shown = show if show in SHOWS else "now"
        people = monitor.people(db, lab, study, chosen, shown)
        [flow] = flows(db, study.row.id, lab.now(), [chosen])
        surround = frame(db, lab, visitor)
    url = f"/admin/studies/{slug}/monitor"
    arms = progress.arms[chosen]
    page = MonitorPage(
        frame=surround,
        head=head(study, "monitor"),
        mode=chosen,
        modes=tuple(
            Filter(f"{name.capitalize()} {counts.people.allocated}", f"{url}?mode={name}", name == chosen)
            for name, counts in progress.modes.items()
        ),
        counts=progress.modes[chosen],
        never_entered=sum(people for _, people in admin_flow.boxes(flow)[0].lost),
        flow=admin_flow.boxes(flow),
        flow_arms=admin_flow.arms(flow),
        arms=tuple(arm for arm in arms if arm.version == progress.newest),
        earlier=tuple(arm for arm in arms if arm.version != progress.newest),
        shows=shows(progress.modes[chosen], url, chosen, shown),
        people=people,
        people_left=max(0, shown_of(progress.modes[chosen], shown) - len(people)),
        links=entry_links(lab, study),
        updated=f"{lab.now():%H:%M:%S} UTC",
        missing=tuple(sorted(studies.missing_agents(study, lab))),
    )
    return html(page)


def shows(counts: ModeCounts, url: str, mode: str, shown: str) -> tuple[Filter, ...]:
    names = {"now": "Playing", "finished": "Finished", "left": "Left", "excluded": "Excluded"}
    return tuple(
        Filter(
            f"{names[show]} {shown_of(counts, show)}",
            f"{url}?{urlencode({'mode': mode, 'show': show})}",
            show == shown,
        )
        for show in SHOWS
    )


def shown_of(counts: ModeCounts, show: str) -> int:
    people = counts.people
    shown = {"now": people.active, "finished": people.finished, "left": people.left}
    return (shown | {"excluded": people.excluded})[show]


@router.get("/admin/studies/{slug}/export.zip")
def download(lab: CurrentLab, slug: str, modes: Modes = [], *, practice: bool = False) -> Response:  # noqa: B006 (FastAPI reads it)
    """Wrong modes and unknown studies are answered before the first byte."""
    pieces = stream_zip(lab, slug, modes, practice=practice)
    name = "-".join(["hatlab", slug, *(mode for mode in MODES if mode in (modes or ["live"]))])
    headers = {
        "content-disposition": f'attachment; filename="{name}-{lab.now():%Y%m%d-%H%M}.zip"',
        "cache-control": "no-store",
    }
    return StreamingResponse(pieces, media_type="application/zip", headers=headers)
