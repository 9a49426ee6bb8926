"""Is the server fit to serve? For load balancers and for whoever wonders."""

from typing import Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse

from server.domain.errors import NotReadyError
from server.services.lab import Lab
from server.web.dependencies import CurrentLab

router = APIRouter()


@router.get("/healthz")
def healthz(lab: CurrentLab) -> JSONResponse:
    """200 if people can play; 503 if the database cannot be reached or lacks a migration.

    A bundle that failed to load is named, but no reason to turn people away: studies that need it are paused.
    """
    state = database_state(lab)
    body = {**state, "bundles": sorted(lab.bundles), "bundle_errors": list(lab.bundle_errors)}
    fit = state["database"] and state["migrated"]
    return JSONResponse({"ok": fit, **body}, 200 if fit else 503, {"cache-control": "no-store"})


def database_state(lab: Lab) -> dict[str, Any]:
    try:
        return {"database": True, "migrated": lab.database.is_current()}
    except NotReadyError:
        return {"database": False, "migrated": False}
