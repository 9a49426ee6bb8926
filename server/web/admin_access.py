"""Who may use the admin pages: the session cookie, and the secret that every form must send back.

Before anybody has signed in there is no session; the login form carries a signed copy of a cookie instead.
"""

import hmac
import secrets
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import quote

from fastapi import Depends, HTTPException, Request
from itsdangerous import BadSignature, TimestampSigner
from starlette.responses import Response

from server.domain.errors import HatlabError
from server.services import accounts
from server.services.lab import Lab
from server.web.dependencies import CurrentLab, Fields

SESSION_COOKIE = "hatlab-admin"
LOGIN_COOKIE = "hatlab-login"
LOGIN_FORM_S = 3_600
LOGIN_URL = "/admin/login"
HOME = "/admin"


class FormRefusedError(HatlabError):
    """The form did not come from a page of ours that this person had open."""

    status = 403
    title = "This form is out of date"


@dataclass(frozen=True, slots=True)
class Visitor:
    """An experimenter who is signed in."""

    username: str
    csrf: str
    key: str


def signed_in(request: Request, lab: CurrentLab) -> Visitor:
    """The experimenter, or a redirect to the login page. Every admin route but login depends on it."""
    key = request.cookies.get(SESSION_COOKIE, "")
    with lab.database.reading() as db:
        session = accounts.session(db, lab, key)
    if session is None:
        target = request.url.path if request.method == "GET" else HOME
        raise HTTPException(303, headers={"location": f"{LOGIN_URL}?next={quote(target)}"})
    return Visitor(session.username, session.csrf, key)


CurrentVisitor = Annotated[Visitor, Depends(signed_in)]


async def checked_form(visitor: CurrentVisitor, fields: Fields) -> dict[str, str]:
    """The fields of a form that carried the session's secret.

    Raises:
        FormRefusedError: it did not.
    """
    sent = fields.pop("csrf", "")
    if not hmac.compare_digest(sent.encode(), visitor.csrf.encode()):
        raise FormRefusedError("Nothing was changed. Go back, reload the page and try again.")
    return fields


CheckedForm = Annotated[dict[str, str], Depends(checked_form)]


def login_form_key(lab: Lab) -> tuple[str, str]:
    """A cookie for the login page and what its form must carry."""
    nonce = secrets.token_urlsafe(16)
    return nonce, login_signer(lab).sign(nonce).decode()


def check_login_form(request: Request, lab: Lab, sent: str) -> None:
    """See that the login form is younger than an hour and belongs to this browser.

    Raises:
        FormRefusedError: it does not.
    """
    nonce = request.cookies.get(LOGIN_COOKIE, "")
    try:
        signed = login_signer(lab).unsign(sent, max_age=LOGIN_FORM_S)
    except BadSignature:
        signed = b""
    if not nonce or not hmac.compare_digest(signed, nonce.encode()):
        raise FormRefusedError(
            "Nobody was signed in. Open the sign-in page again and send the form from there."
        )


def login_signer(lab: Lab) -> TimestampSigner:
    return TimestampSigner(lab.secret_key, salt="admin-login")


def set_cookie(
    response: Response, request: Request, lab: Lab, name: str, value: str, lasts_s: int, path: str = HOME
) -> None:
    """HttpOnly, SameSite=Strict, for admin addresses only; Secure wherever the page came over https."""
    is_https = lab.settings.behind_https or request.url.scheme == "https"
    response.set_cookie(
        name, value, max_age=lasts_s, path=path, secure=is_https, httponly=True, samesite="strict"
    )


def safe_target(target: str) -> str:
    """Where to go after signing in: an admin page of this server, whatever the link said."""
    inside = target == HOME or target.startswith((f"{HOME}/", f"{HOME}?"))
    is_plain = target.isprintable() and "\\" not in target and "/.." not in target
    return target if inside and is_plain else HOME
