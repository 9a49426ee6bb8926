"""A browser without a screen: httpx straight into the ASGI application, with a cookie jar.

Redirects are not followed, and an error of the application is raised, unless asked otherwise. (The TestClient
of Starlette wants a package that hatlab does not use.)
"""

from typing import Any

import anyio
import httpx
from starlette.types import ASGIApp


class Client:
    def __init__(
        self, app: ASGIApp, *, raise_errors: bool = True, base_url: str = "http://hatlab.test"
    ) -> None:
        transport = httpx.ASGITransport(app, raise_app_exceptions=raise_errors)
        self.inner = httpx.AsyncClient(transport=transport, base_url=base_url)

    @property
    def cookies(self) -> httpx.Cookies:
        return self.inner.cookies

    def request(self, method: str, url: str, **options: Any) -> httpx.Response:
        async def send() -> httpx.Response:
            return await self.inner.request(method, url, **options)

        return anyio.run(send)

    def get(self, url: str, **options: Any) -> httpx.Response:
        return self.request("GET", url, **options)

    def post(self, url: str, **options: Any) -> httpx.Response:
        return self.request("POST", url, **options)
