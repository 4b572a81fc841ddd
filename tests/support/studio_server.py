"""A real server of the studio, as a process, and requests to it in every form that a page or an attacker sends."""

from __future__ import annotations

import contextlib
import http.client
import json
import subprocess
import sys
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlencode


@dataclass
class Server:
    """A server that runs."""

    process: subprocess.Popen[str]
    root: Path
    port: int
    token: str
    cookie: str = ""

    def ask(
        self, method: str, to: str, /, body: bytes | None = None, headers: dict[str, str] | None = None, **asked: str
    ) -> tuple[int, http.client.HTTPMessage, bytes]:
        """Send a request as the page does, but for the headers given; those given as empty are left out."""
        sent = {"Host": f"127.0.0.1:{self.port}", "Origin": f"http://127.0.0.1:{self.port}", "Cookie": self.cookie}
        sent |= headers or {}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        with contextlib.closing(connection):
            connection.putrequest(method, f"{to}?{urlencode(asked)}" if asked else to, skip_host=True)
            for name, value in sent.items():
                if value:
                    connection.putheader(name, value)
            if body is not None:
                connection.putheader("Content-Length", str(len(body)))
            connection.endheaders(body)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()

    def api(self, method: str, name: str, /, body: str | None = None, **asked: str) -> Any:
        """Return the JSON of an answer; its status must be 200."""
        status, _, content = self.ask(method, f"/api/{name}", None if body is None else body.encode(), None, **asked)
        assert status == 200, content
        return json.loads(content)

    def refused(self, method: str, name: str, /, body: str | None = None, **asked: str) -> str:
        """Return the slug of a refusal."""
        status, _, content = self.ask(method, f"/api/{name}", None if body is None else body.encode(), None, **asked)
        assert status >= 400
        return str(json.loads(content)["slug"])


def start(root: Path, *options: str) -> Server:
    """Start the command in its folder, as the installed one (`-P`): Python looks for no modules there."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "parcours", "studio", str(root), "--port", "0", "--no-open", "--json", *options],
        cwd=root, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    address, _, token = json.loads(process.stdout.readline())["url"].partition("/?token=")
    found = Server(process, root, int(address.rpartition(":")[2]), token)
    status, headers, _ = found.ask("GET", "/", headers={"Origin": "", "Sec-Fetch-Site": "cross-site"}, token=token)
    assert status == 200
    assert "SameSite=Strict" in headers["Set-Cookie"] and "HttpOnly" in headers["Set-Cookie"]
    found.cookie = headers["Set-Cookie"].partition(";")[0]
    return found


def events(server: Server, run: str, until: int = -1, **asked: str) -> Generator[dict[str, Any], None, None]:
    """Yield what the stream of a run says, until so many cases are finished."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    with contextlib.closing(connection):
        connection.request("GET", f"/api/watch?{urlencode({'run': run, **asked})}", headers={"Cookie": server.cookie})
        answer = connection.getresponse()
        assert answer.status == 200
        while line := answer.readline():
            if line.startswith(b"data: "):
                found: dict[str, Any] = json.loads(line[6:])
                yield found
                if found["finished"] == until:
                    return
