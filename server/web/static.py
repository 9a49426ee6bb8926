"""Files of static/: under this version's address kept for ever, under any other asked for anew (ETag)."""

import re

from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from server.web.rendering import STATIC, static_version

VERSION = re.compile(r"v-([0-9a-f]{12})/(.+)", re.DOTALL)
FOR_EVER = "public, max-age=31536000, immutable"
ASK = "no-cache"


class VersionedFiles(StaticFiles):
    """`/static/v-<hash>/<path>` and `/static/<path>`.

    An old hash still finds the file, so that pages which were open during an update live on.
    """

    def __init__(self) -> None:
        super().__init__(directory=STATIC)

    async def get_response(self, path: str, scope: Scope) -> Response:
        versioned = VERSION.fullmatch(path)
        response = await super().get_response(versioned[2] if versioned else path, scope)
        current = versioned is not None and versioned[1] == static_version()
        response.headers["cache-control"] = FOR_EVER if current else ASK
        return response
