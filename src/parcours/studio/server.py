"""Serves the studio of one folder on the loopback interface: pages, answers and events, all behind the guard."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import functools
import json
import re
import signal
import socket
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from importlib.resources import files
from types import FrameType

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from parcours.errors import BadRequest, ParcoursError
from parcours.paths import CRITERIA
from parcours.studio.checking import checked, drawings, pictures_of, require_sound
from parcours.studio.children import StudioRuns, answer_of, lines_of
from parcours.studio.folder import Folder, kind_of
from parcours.studio.guarding import TokenGuard
from parcours.studio.stepping import planned
from parcours.studio.watching import PERIOD, Watched, code_in, study_behind, summary
from parcours.study.finding import registered
from parcours.study.parameters import OPTIONS

_OWN = {"": ("page.html", "text/html"), "studio.js": ("studio.js", "text/javascript"),
        "studio.css": ("studio.css", "text/css")}  # fmt: skip
_QUIET = 300  # looks without news after which a line says that the server is still there
_MOST_WATCHED = 16
_MOST_LOADED = 16  # studies
_PARAMETER = re.compile(r"[a-z][a-z0-9_-]*")
_CHOICES = [name for name in CRITERIA if name.islower()]  # the others take a number or names
_STATUS = {"studio-changed": 409, "studio-running": 409, "studio-file": 404, "studio-size": 413}

Endpoint = Callable[[Request], Awaitable[Response]]


class Studio:
    """What the page can ask about a folder."""

    def __init__(self, folder: Folder) -> None:
        self.folder = folder
        self.runs = StudioRuns(folder)
        self.closing = False
        self._watchers = 0
        self._loaded: set[str] = set()  # studies that are loaded, or are being loaded
        self._loading: set[asyncio.Task[None]] = set()

    def app(self, token: str, port: int) -> TokenGuard:
        """Return the application, which answers the browser that was given the token."""
        answers: dict[tuple[str, str], Callable[[Request], Awaitable[object]]] = {
            ("GET", "files"): self.files, ("GET", "file"): self.file, ("PUT", "file"): self.save,
            ("POST", "check"): self.check, ("POST", "paths"): self.paths, ("POST", "cases"): self.cases,
            ("POST", "step"): self.step, ("POST", "study"): self.study, ("POST", "run"): self.run,
            ("POST", "stop"): self.stop, ("GET", "state"): self.state, ("POST", "compare"): self.compare,
        }  # fmt: skip
        routes = [Route(f"/api/{name}", _answered(answer), methods=[method])
                  for (method, name), answer in answers.items()]  # fmt: skip
        routes += [Route(f"/{name}", functools.partial(_own, name)) for name in _OWN]
        routes.append(Route("/api/watch", self.watch))
        return TokenGuard(Starlette(routes=routes, exception_handlers={ParcoursError: _refused}), token, port)

    async def files(self, request: Request) -> object:
        """Return what the folder holds: files, and runs with what they say of themselves."""
        entries, is_all = await run_in_threadpool(self.folder.entries)
        runs = [one.path for one in entries if one.kind == "run"]
        said = await run_in_threadpool(lambda: [summary(self.folder, run) for run in runs])
        listed = [dataclasses.asdict(one) for one in entries if one.kind != "run"]
        self._load_ahead(said)
        return {
            "studies": sorted(_names()),
            "folder": self.folder.root.name,
            "files": listed,
            "runs": said,
            "all": is_all,
            "criteria": _CHOICES,
        }

    def _load_ahead(self, runs: Sequence[Mapping[str, object]]) -> None:
        """Load the studies behind some runs, one run of each, before anybody watches them."""
        new = {
            str(one["study"]): str(one["run"]) for one in runs if "study" in one and one["study"] not in self._loaded
        }
        chosen = dict(list(new.items())[: _MOST_LOADED - len(self._loaded)])
        self._loaded |= chosen.keys()

        async def load() -> None:
            for run in chosen.values():
                with contextlib.suppress(ParcoursError, OSError):  # a look at it says why
                    await run_in_threadpool(Watched(self.folder, run).load)

        if chosen:
            self._loading.add(task := asyncio.create_task(load()))
            task.add_done_callback(self._loading.discard)

    async def file(self, request: Request) -> object:
        """Return the text of a file, and its version."""
        return dataclasses.asdict(await run_in_threadpool(self.folder.text, _asked(request, "path")))

    async def save(self, request: Request) -> object:
        """Replace a file if it still has the version that was opened."""
        text = await _text(request)
        arguments = _asked(request, "path"), text, _asked(request, "version")
        return {"version": await run_in_threadpool(self.folder.save, *arguments)}

    async def check(self, request: Request) -> object:
        """Return what is wrong with a text, and drawings of its model."""
        text, path = await _text(request), _asked(request, "path")
        await run_in_threadpool(self.folder.text, path)  # it is a file of the folder

        def look() -> object:
            found = checked(self.folder, path, text)
            return {"findings": [dataclasses.asdict(one) for one in found.findings], "drawings": pictures_of(found)}

        return await run_in_threadpool(look)

    async def paths(self, request: Request) -> object:
        """Return internal paths of a model by a criterion."""
        criterion = f"--criterion={_asked(request, 'criterion')}"
        return await answer_of(self.folder, ["paths", await self._sound(request), criterion, "--json"])

    async def cases(self, request: Request) -> object:
        """Return the abstract cases of a model."""
        return await answer_of(self.folder, ["abtc", await self._sound(request), "--json"])

    async def step(self, request: Request) -> object:
        """Return what happens in an abstract case: of a study executed, of a model as it is demanded."""
        full, case, path = await self._sound(request), _asked(request, "case"), _asked(request, "path")
        text = (await run_in_threadpool(self.folder.text, path)).text
        model = (await run_in_threadpool(checked, self.folder, path, text)).model
        if model is None:
            raise BadRequest(path, "it has no model to step through", slug="studio-step")
        if kind_of(text) == "model":
            happened = await run_in_threadpool(planned, model, case)
        else:
            found = await answer_of(self.folder, [full, case], "parcours.studio.stepping")
            assert isinstance(found, dict)
            happened = found
        return happened | {"drawings": await run_in_threadpool(drawings, model)}

    async def study(self, request: Request) -> object:
        """Return what the battery for authors finds; it runs the study's code, apart."""
        return await answer_of(self.folder, ["study", "check", await self._sound(request), "--json"])

    async def run(self, request: Request) -> object:
        """Start a run of a study: a study.yaml, `file.py:NAME` in the folder, or a registered one; with settings."""
        path = _asked(request, "path")
        code = await run_in_threadpool(code_in, self.folder, str(self.folder.root / path))
        named = path if path in _names() else code or await self._sound(request)
        options = [_option(one) for one in request.query_params.get("settings", "")[:4096].split()]
        cases = request.query_params.get("cases", "")
        if cases and not (cases.isascii() and cases.isdecimal() and 0 < int(cases) <= 100_000_000):
            raise BadRequest(
                "cases", f"must be a number from 1 to 100000000, but is {cases[:20]!r}", slug="studio-cases"
            )
        options += [f"--cases={int(cases)}"] if cases else []
        return {"run": await self.runs.start(path, named, options)}

    async def stop(self, request: Request) -> object:
        """End a run that the studio started."""
        await self.runs.stop(_asked(request, "run"))
        return {}

    async def state(self, request: Request) -> object:
        """Return how a run goes that the studio started."""
        return self.runs.state(_asked(request, "run"))

    async def compare(self, request: Request) -> object:
        """Return how a run compares with an earlier one."""
        runs = _asked(request, "before"), _asked(request, "now")
        if not request.query_params.get("code"):  # else the command runs it, apart
            for run in runs:
                await run_in_threadpool(study_behind, self.folder, run)
        found = await answer_of(self.folder, ["compare", *(str(self.folder.directory(run)) for run in runs), "--json"])
        assert isinstance(found, dict)
        return next(iter(found.values()))

    async def watch(self, request: Request) -> Response:
        """Return a stream of events: what is known of a run, each time that it changes."""
        run = _asked(request, "run")
        watched = await run_in_threadpool(Watched, self.folder, run)
        if self._watchers >= _MOST_WATCHED:
            raise HTTPException(429, "Too many runs are watched at once.")
        events = self._events_apart(run) if request.query_params.get("code") else self._events(watched)
        return StreamingResponse(events, media_type="text/event-stream")

    async def _events_apart(self, run: str) -> AsyncIterator[str]:
        """Yield the same of a run whose study is code of the folder, read by a process of its own."""
        self._watchers += 1
        lines = lines_of(self.folder, "parcours.studio.watching", [str(self.folder.root), run])
        ahead = None
        try:
            while not self.closing:
                ahead = ahead or asyncio.ensure_future(anext(lines))
                done, _ = await asyncio.wait([ahead], timeout=1.0)
                if done:
                    yield f"data: {ahead.result()}\n\n"
                    ahead = None
        except ParcoursError as error:
            yield f"event: refused\ndata: {_json({'error': str(error), 'slug': error.slug})}\n\n"
        finally:
            self._watchers -= 1
            if ahead is not None:
                ahead.cancel()
                await asyncio.wait([ahead])
            await lines.aclose()

    async def _events(self, watched: Watched) -> AsyncIterator[str]:
        self._watchers += 1
        quiet = 0
        try:
            while not self.closing:
                try:
                    news = await run_in_threadpool(watched.news)
                except ParcoursError as error:
                    yield f"event: refused\ndata: {_json({'error': str(error), 'slug': error.slug})}\n\n"
                    return
                quiet = 0 if news is not None else quiet + 1
                if news is not None:
                    yield f"data: {_json(news)}\n\n"
                elif quiet % _QUIET == 0:
                    yield ": still here\n\n"
                await asyncio.sleep(PERIOD)
        finally:
            self._watchers -= 1

    async def _sound(self, request: Request) -> str:
        path = _asked(request, "path")
        await run_in_threadpool(require_sound, self.folder, path)
        return str(self.folder.root / path)


def _names() -> set[str]:
    return {one.name for one in registered()}


def _option(setting: str) -> str:
    """Return NAME=VALUE, a parameter of a study, as an option of `parcours run`."""
    name, equals, value = setting.partition("=")
    if not equals or not _PARAMETER.fullmatch(name) or name.replace("-", "_") in OPTIONS:
        rule = f"a setting must be NAME=VALUE, a parameter of the study, but is {setting[:80]!r}"
        raise BadRequest("settings", rule, "see `parcours run STUDY --help`", slug="studio-setting")
    return f"--{name.replace('_', '-')}={value}"


def _asked(request: Request, name: str) -> str:
    value = request.query_params.get(name, "")
    if not value or len(value) > 4096:
        raise BadRequest(name, "a request must give it, but this one does not", slug="studio-file")
    return value


async def _text(request: Request) -> str:
    try:
        return (await request.body()).decode()
    except UnicodeDecodeError:
        raise BadRequest("text", "must be UTF-8, but is not", slug="studio-file") from None


def _answered(answer: Callable[[Request], Awaitable[object]]) -> Endpoint:
    async def endpoint(request: Request) -> Response:
        return Response(_json(await answer(request)), media_type="application/json")

    return endpoint


async def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, ParcoursError)
    status = _STATUS.get(error.slug, 400)
    return Response(_json({"error": str(error), "slug": error.slug}), status, media_type="application/json")


async def _own(name: str, request: Request) -> Response:
    file, kind = _OWN[name]
    return Response((files("parcours.studio") / file).read_bytes(), media_type=kind)


def _json(value: object) -> str:
    return json.dumps(value)  # ASCII: a name may hold halves of characters


class _Server(uvicorn.Server):
    """A server that a signal ends without an error, streams and runs first."""

    def __init__(self, config: uvicorn.Config, studio: Studio) -> None:
        super().__init__(config)
        self._studio = studio

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End; a second Ctrl-C ends at once."""
        self._studio.closing = True
        self.force_exit = self.should_exit and sig == signal.SIGINT
        self.should_exit = True

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the runs, then the server."""
        await self._studio.runs.stop_all()
        await super().shutdown(sockets)


def bound(port: int) -> socket.socket:
    """Return a socket on the loopback interface. Raises BadRequest: the port is in use or not allowed."""
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
    except OSError as error:
        listener.close()
        rule = f"a port must be free, but: {error.strerror}"
        raise BadRequest(f"port {port}", rule, "name another one, or 0 for any", slug="studio-port") from error
    return listener


def serve(studio: Studio, listener: socket.socket, token: str) -> None:
    """Serve until a signal ends it."""
    app = studio.app(token, listener.getsockname()[1])
    config = uvicorn.Config(
        app, log_level="error", access_log=False, lifespan="off", ws="none", loop="asyncio", http="h11",
        proxy_headers=False, server_header=False, timeout_graceful_shutdown=2, limit_concurrency=100,
    )  # fmt: skip
    server = _Server(config, studio)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as under nohup
        signal.signal(signal.SIGHUP, server.handle_exit)
    with contextlib.closing(listener):
        server.run([listener])
