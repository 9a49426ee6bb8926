"""Admin: signing in and out, and the router under which all admin pages stand."""

import math

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse
from starlette.responses import Response

from server.services import accounts
from server.services.accounts import SignedIn, Wait
from server.services.lab import Lab
from server.web import admin_agents, admin_build, admin_launch, admin_list, admin_monitor, admin_recruit
from server.web.admin_access import (
    HOME,
    LOGIN_COOKIE,
    LOGIN_FORM_S,
    LOGIN_URL,
    SESSION_COOKIE,
    CheckedForm,
    CurrentVisitor,
    check_login_form,
    login_form_key,
    safe_target,
    set_cookie,
)
from server.web.admin_pages import LoginPage
from server.web.dependencies import CurrentLab, Fields
from server.web.rendering import html

router = APIRouter()
WRONG = "That username and password do not belong together. Check both and try again."


@router.get(LOGIN_URL)
def login_page(request: Request, lab: CurrentLab, next: str = HOME) -> Response:  # noqa: A002 (the name in the link)
    return login_form(request, lab, safe_target(next))


@router.post(LOGIN_URL)
def login(request: Request, lab: CurrentLab, fields: Fields) -> Response:
    check_login_form(request, lab, fields.get("csrf", ""))
    target = safe_target(fields.get("next", HOME))
    username = fields.get("username", "")
    source = request.client.host if request.client else "unknown"
    result = accounts.login(lab, username, fields.get("password", ""), source)
    if isinstance(result, SignedIn):
        response = RedirectResponse(target, 303)
        set_cookie(response, request, lab, SESSION_COOKIE, result.key, result.lasts_s)
        response.delete_cookie(LOGIN_COOKIE, path=HOME)
        return response
    if isinstance(result, Wait):
        return login_form(
            request, lab, target, username, too_many(result.seconds), 429, retry_after_s=result.seconds
        )
    return login_form(request, lab, target, username, WRONG, 401)


def login_form(
    request: Request,
    lab: Lab,
    target: str,
    username: str = "",
    error: str | None = None,
    status: int = 200,
    retry_after_s: int = 0,
) -> Response:
    nonce, signed = login_form_key(lab)
    headers = {"retry-after": str(retry_after_s)} if retry_after_s else None
    response = html(LoginPage(signed, target, username, error), status, headers=headers)
    set_cookie(response, request, lab, LOGIN_COOKIE, nonce, LOGIN_FORM_S)
    return response


def too_many(seconds: int) -> str:
    """How long to wait, in words."""
    if seconds < 60:
        return f"Too many attempts. Try again in {seconds} {'second' if seconds == 1 else 'seconds'}."
    minutes = math.ceil(seconds / 60)
    return f"Too many attempts. Try again in {minutes} {'minute' if minutes == 1 else 'minutes'}."


@router.post("/admin/logout")
def logout(lab: CurrentLab, visitor: CurrentVisitor, _: CheckedForm) -> Response:
    with lab.database.writing() as db:
        accounts.logout(db, visitor.key)
    response = RedirectResponse(LOGIN_URL, 303)
    response.delete_cookie(SESSION_COOKIE, path=HOME)
    return response


for part in (admin_list, admin_build, admin_launch, admin_monitor, admin_recruit, admin_agents):
    router.include_router(part.router)
