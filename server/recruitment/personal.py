"""Personal links for a lab's own list: an invitation names a person, and only this lab can write one.

The name can be read in the link (it is encoded, not hidden); the signature keeps others from making one up.
An invitation is for one study: in another study's link it is a forgery.
"""

import base64
import hashlib
import re
import secrets
from collections.abc import Callable, Iterable, Mapping
from urllib.parse import urlencode

from itsdangerous import BadSignature, Signer

from server.recruitment.arrival import Arrival

PARAMETER = "invite"
CODE = re.compile(r"[\w.-]{1,500}", re.ASCII)
NAME_MAX = 64
SEPARATOR = "."
DRAWN_BYTES = 5  # 8 letters: 40 bits, so that two draws of thousands do not meet

Reader = Callable[[str], str | None]
"""From a code to the name in it; None: not ours."""


def code_of(name: str, slug: str, key: str) -> str:
    """The invitation of a person to a study, under the lab's secret key.

    Raises:
        ValueError: the name is empty, longer than 64 characters, or not one line of text.
    """
    if name != name.strip() or not name.isprintable() or not 0 < len(name) <= NAME_MAX:
        raise ValueError(f"{name!r} cannot be a name: use 1 to {NAME_MAX} characters of one line")
    text = base64.urlsafe_b64encode(name.encode()).decode().rstrip("=")
    return signer(slug, key).sign(text).decode()


def name_of(code: str, slug: str, key: str) -> str | None:
    """Who is invited by the code; None where this key did not sign it for this study."""
    try:
        text = signer(slug, key).unsign(code).decode()
        return base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)).decode()
    except (BadSignature, ValueError):
        return None


def signer(slug: str, key: str) -> Signer:
    return Signer(key, salt=f"invite:{slug}", sep=SEPARATOR, digest_method=hashlib.sha256)


def nobody(_code: str) -> str | None:
    """The reader of somebody who has no key."""
    return None


def recognise(query: Mapping[str, str], read: Reader) -> Arrival | None:
    """The arrival, where the link is a personal one; `forged` where the code is not ours."""
    code = query.get(PARAMETER)
    if code is None:
        return None
    name = read(code) if CODE.fullmatch(code) else None
    if name is None:
        return Arrival("list", forged=True)
    return Arrival("list", name, parameters={PARAMETER: code})


def link(public_url: str, slug: str, code: str) -> str:
    return f"{public_url}/s/{slug}?{urlencode({PARAMETER: code})}"


def names_in(lines: Iterable[str]) -> list[str]:
    """One name a line, empty lines left out.

    Raises:
        ValueError: a name stands there twice: two people would share one session.
    """
    names = [stripped for line in lines if (stripped := line.strip())]
    twice = next((name for index, name in enumerate(names) if name in names[:index]), None)
    if twice is not None:
        raise ValueError(f"{twice!r} stands there twice")
    return names


def drawn(count: int) -> list[str]:
    """So many new names that say nothing about anybody."""
    return [base64.b32encode(secrets.token_bytes(DRAWN_BYTES)).decode() for _ in range(count)]
