"""Answers only the browser that was given the token, and pages of this very server.

    request ─► Host ours? ─► Origin ours? ─► token in the address once, a cookie from then on ─► the studio

A page of another site cannot send the cookie (SameSite=Strict). One of another port of this machine can, as a browser
counts it as the same site: it is refused by `Origin` and `Sec-Fetch-Site`. A name that resolves to this machine (DNS
rebinding) is refused by `Host`.
"""

from __future__ import annotations

import hmac
import secrets
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST_SENT = 1_100_000
"""Largest body of a request [bytes]: a text of the largest size, and something for safety."""

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""What every answer tells the browser: run and load nothing but the studio's own files."""


class TokenGuard:
    """Lets requests through to an application that come from the browser that was given the token."""

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        self._cookie = f"parcours-studio-{port}"  # cookies of a machine are shared by all its ports
        self._session = secrets.token_urlsafe(32)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or hand it on."""
        if scope["type"] != "http":
            return
        headers = Headers(scope=scope)

        starts = scope["path"] == "/" and _same(_token(scope), self._token)

        async def send_safely(message: Message) -> None:
            if message["type"] == "http.response.start":
                answered = MutableHeaders(scope=message)
                answered.update(HEADERS)
                if starts and message["status"] == 200:
                    cookie = f"{self._cookie}={self._session}; HttpOnly; Path=/; SameSite=Strict"
                    answered.append("Set-Cookie", cookie)
            await send(message)

        refusal = self._refusal(scope, headers, starts)
        if refusal is not None:
            await refusal(scope, receive, send_safely)
        else:
            await self._app(scope, _bounded(receive), send_safely)

    def _refusal(self, scope: Scope, headers: Headers, starts: bool) -> Response | None:
        """Return why a request is not answered; None if it may pass, as one with the token may."""
        host, origins = headers.getlist("host"), headers.getlist("origin")
        if len(host) != 1 or host[0] not in self._hosts:
            return PlainTextResponse("This address is not the studio's.\n", 421)
        if any(one != f"http://{host[0]}" for one in origins) or (not origins and scope["method"] not in _READING):
            return PlainTextResponse("The studio answers its own pages only.\n", 403)
        if starts:  # also from a link elsewhere, which does not send the cookie
            return None
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return PlainTextResponse("The studio answers its own pages only.\n", 403)
        if not _same(_cookie(headers.get("cookie", ""), self._cookie), self._session):
            return PlainTextResponse("Open the address that `parcours studio` printed: it holds the token.\n", 403)
        if int(_digits(headers.get("content-length", "0"))) > MOST_SENT:
            return PlainTextResponse("That is too large.\n", 413)
        return None


_READING = ("GET", "HEAD")


def _token(scope: Scope) -> str:
    query = bytes(scope["query_string"]).decode("latin-1")
    return parse_qs(query).get("token", [""])[0]


def _same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(errors="replace"), wanted.encode())


def _cookie(header: str, name: str) -> str:
    try:
        found = SimpleCookie(header).get(name)
    except CookieError:
        return ""
    return found.value if found is not None else ""


def _digits(text: str) -> str:
    return text if text.isascii() and text.isdecimal() and len(text) < 19 else "9" * 18


def _bounded(receive: Receive) -> Receive:
    """Return the same without more of a body than may be sent."""
    left = MOST_SENT

    async def bounded() -> Message:
        nonlocal left
        message = await receive()
        left -= len(message.get("body", b""))
        if left < 0:
            raise HTTPException(413, "That is too large.")
        return message

    return bounded
