"""The studio's server: viser's page and websocket, behind guards, with a work to each page.

viser 1.1.1 binds every interface, takes any Host and Origin, tells a page's wish to share to a server elsewhere, and
trusts what a page says. All that stands between is here. The version is pinned: this file is the only one that uses
what viser does not promise, and tests/studio has a test of each use.
"""

from __future__ import annotations

import base64
import contextlib
import errno
import gzip
import hashlib
import logging
import os
import re
import secrets
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facegen.errors import FacegenError, InputError
from facegen.studio import guard
from facegen.studio.limits import Limits

if TYPE_CHECKING:
    import viser

log = logging.getLogger("facegen.studio")

VISER = "1.1.1"
TITLE = "facegen studio"
INSTALL = 'pip install "facegen[studio]"'
PORTS = 100         # tried one after another when the port was not asked for
ID_BYTES = 24       # 192 bits: nobody guesses a work

# The page unpacks its program and puts it in as one script: this is what that script has to be.
_PROGRAM = "sha256-o/BTEGoB4UnTxqb+3RxwUFQZkWXpqUxouHkbDNrAkqE="

OnPage = Callable[["viser.ClientHandle", str], Any]


class StudioServer:
    """A server of the studio's page.

    ::

        with StudioServer(port=0, on_page=lambda client, work: client.gui.add_slider("smile", 0, 1, 0.01, 0)) as server:
            print(server.url)

    host, port: where it listens; port 0 takes any that is free. exact: whether another port will do when it is taken.
    token: what a visitor must bring; None asks for none on this machine alone, and makes one for any other host.
    on_page, on_page_closed: called on a thread of their own with the page (viser's ClientHandle) and the id of its
    work, when a page came and when it went; a page that is loaded again comes again with the same id.
    Raises InputError for a host, port or token that cannot be, FacegenError without viser.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 8092, token: str | None = None,
                 limits: Limits | None = None, on_page: OnPage | None = None, on_page_closed: OnPage | None = None, *,
                 exact: bool = True) -> None:
        self.host, self.limits, self.exact = host, limits or Limits(), exact
        if not 0 <= port <= 65535:
            raise InputError(f"port: expected 0 to 65535, got {port}")
        if token is not None and not re.fullmatch(r"[\x21-\x3a\x3c-\x7e]{8,200}", token):
            raise InputError("token: expected 8 to 200 visible ASCII characters without ';' or blanks")
        if token is None and not guard.is_loopback(host):
            token = secrets.token_urlsafe(ID_BYTES)
        self.token, self.port = token, port
        self._asked_port = port
        self._on_page, self._on_page_closed = on_page, on_page_closed
        self._work_of: dict[int, str] = {}
        self._viser: Any = None
        self._open = False

    @property
    def url(self) -> str:
        """Where the studio is, with the token that lets in."""
        name = self._names()[0]
        return f"http://{name}:{self.port}/" + (f"?token={self.token}" if self.token else "")

    @property
    def viser(self) -> viser.ViserServer:
        """viser's own server; InputError before `start`."""
        if self._viser is None:
            raise InputError("the server does not run: call start() first")
        return self._viser

    def start(self) -> StudioServer:
        """Listen, and return the server itself. Raises InputError for a host or port that cannot be had."""
        viser = _viser()
        listening = _listen(self.host, self._asked_port, 1 if self.exact else PORTS)
        self.port = listening.getsockname()[1]
        self._page = _Page.read(Path(viser.__file__).parent / "client" / "build" / "index.html")
        try:
            with _serving(self, listening), _silent():
                self._viser = viser.ViserServer(host=_Ours("127.0.0.1"), port=self.port, label=TITLE, verbose=False)
        except BaseException:
            listening.close()
            raise
        self._refuse_share()
        scene = self._viser.scene       # both cost a machine without a GPU its frames
        scene.configure_default_lights(cast_shadow=False)
        scene.configure_environment_map(None)
        self._viser.gui.configure_theme(show_share_button=False, show_logo=False)
        self._viser.on_client_connect(self._connected)
        self._viser.on_client_disconnect(self._disconnected)
        self._open = True
        return self

    def stop(self) -> None:
        """Close every page and listen no more."""
        if self._viser is not None:
            self._open = False
            with _silent():
                self._viser.stop()
            self._viser = None

    def __enter__(self) -> StudioServer:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _names(self) -> list[str]:
        """The names this server answers to, as they stand in a URL, the best first."""
        if guard.is_loopback(self.host):
            own = f"[{self.host}]" if ":" in self.host else self.host
            return [own, *(name for name in guard.LOOPBACK_NAMES if name != own)]
        if self.host in ("0.0.0.0", "::", ""):
            return [socket.gethostname(), socket.getfqdn(), *guard.LOOPBACK_NAMES]
        return [f"[{self.host}]" if ":" in self.host else self.host]

    def answer(self, connection: Any, request: Any) -> Any:
        """Answer a request for a page, or refuse; None lets a websocket go on."""
        every = request.headers.get_all
        path, _, query = request.path.partition("?")
        websocket = any(value.casefold() == "websocket" for value in every("Upgrade"))
        given = guard.token_given(every, query, self.port)
        allowed = self.token is None or guard.is_token(given, self.token)
        trusted = self.token is not None and allowed
        wild = self.host in ("0.0.0.0", "::", "")
        refusal = (guard.check_host(every("Host"), self._names(), self.port, addresses=wild)
                   or guard.check_origin(every, websocket=websocket, trusted=trusted))
        if refusal is None and not allowed:
            refusal = guard.Refusal(403, "this studio wants its token: open the address that `facegen studio` printed, "
                                         "the one with ?token=")
        if refusal is None and not self._open:
            refusal = guard.Refusal(503, "the studio is starting or ending; try again")
        if refusal is not None:
            log.warning("refused %s %s: %s", "a websocket to" if websocket else "a request for", _shown(path),
                        refusal.why)
            return _plain(refusal.status, refusal.why)
        work = guard.work_of(path)
        if work is None and (path != "/" or websocket):
            return _plain(404, "there is nothing here; the studio begins at /")
        if websocket:
            return None
        host = every("Host")[0].strip()
        if query:       # the token goes into a cookie; and viser's page would connect to where ?websocket= says
            found = _moved(path)
            if self.token and "token" in query:
                found.headers["Set-Cookie"] = (f"{guard.cookie_name(self.port)}={self.token}; HttpOnly; "
                                               "SameSite=Strict; Path=/")
            return found
        if work is None:
            return _moved(f"/w/{secrets.token_urlsafe(ID_BYTES)}")
        return self._page.response(host, "gzip" in ",".join(every("Accept-Encoding")))

    def _refuse_share(self) -> None:
        """Take away every way by which a page or a caller makes viser open a tunnel to elsewhere."""
        from viser import _messages

        def refuse(*_: Any, **__: Any) -> None:
            log.warning("refused to share the studio: nothing of it leaves this machine")

        for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            self._viser._websock_server.unregister_handler(message)
        self._viser.request_share_url = refuse
        self._viser.disconnect_share_url = refuse

    def _connected(self, client: Any) -> None:
        connection = self._viser._websock_server._live_connections.get(client.client_id)
        work = guard.work_of(connection.request.path.partition("?")[0]) if connection is not None else None
        if work is None:        # it went before it came
            return
        self._work_of[client.client_id] = work
        if self._on_page is not None:
            self._on_page(client, work)

    def _disconnected(self, client: Any) -> None:
        work = self._work_of.pop(client.client_id, None)
        if work is not None and self._on_page_closed is not None:
            self._on_page_closed(client, work)


class _Ours(str):
    """The host given to viser: it tells our own call of `websockets.serve` from anybody else's."""

    __slots__ = ()


_patching = threading.Lock()


@contextlib.contextmanager
def _serving(server: StudioServer, listening: socket.socket) -> Iterator[None]:
    """Have viser's one call of `websockets.asyncio.server.serve` listen on our socket and ask us first."""
    import websockets.asyncio.server as module

    def serve(handler: Any, host: Any = None, port: Any = None, **options: Any) -> Any:
        if not isinstance(host, _Ours):
            return original(handler, host, port, **options)
        quiet = logging.getLogger("facegen.studio.websockets")
        quiet.disabled = True       # it tells of every refused handshake with a traceback; `answer` has a line for each
        options |= {"process_request": server.answer, "max_size": server.limits.message_bytes, "logger": quiet}
        return original(handler, sock=listening, **options)

    with _patching:
        original = module.serve
        module.serve = serve
        try:
            yield
        finally:
            module.serve = original


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Drop what viser prints about itself."""
    import rich

    def say(*args: Any, **options: Any) -> None:
        if not sys._getframe(1).f_globals.get("__name__", "").startswith("viser"):
            original(*args, **options)

    with _patching if not _patching.locked() else contextlib.nullcontext():
        original = rich.print
        rich.print = say
        try:
            yield
        finally:
            rich.print = original


def _viser() -> Any:
    try:
        import viser
    except ImportError as error:
        raise FacegenError(f"the studio needs viser ({error}); install it with: {INSTALL}") from None
    if viser.__version__ != VISER:
        raise FacegenError(f"the studio needs viser {VISER}, found {viser.__version__}; install it with: {INSTALL}")
    return viser


def _listen(host: str, port: int, tries: int) -> socket.socket:
    """Return a listening socket at the first free port."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host or "0.0.0.0", None, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError):
        raise InputError(f"host: '{host}' is no address of this machine; expected for example 127.0.0.1") from None
    for number in range(port, min(port + tries, 65536)):
        found = socket.socket(family, socket.SOCK_STREAM)
        try:
            if os.name == "posix":
                found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            found.bind((address[0], number, *address[2:]))
            found.listen(128)
            return found
        except OSError as error:
            found.close()
            if error.errno == errno.EADDRINUSE:
                continue
            raise InputError(f"cannot listen at {host}:{number}: {error.strerror}") from None
    raise InputError(f"port: {port} is taken; stop what listens there (another studio?), or choose one with --port")


class _Page:
    """viser's page with our title, and the headers that keep it to itself."""

    def __init__(self, plain: bytes, script: str) -> None:
        self.plain, self.packed, self.script = plain, gzip.compress(plain, 6), script

    @classmethod
    def read(cls, path: Path) -> _Page:
        text = path.read_text("utf-8")
        text = text.replace("<title>Viser</title>", f"<title>{TITLE}</title>", 1)
        scripts = re.findall(r"<script[^>]*>(.*?)</script>", text, re.S)
        digest = base64.b64encode(hashlib.sha256("".join(scripts).encode()).digest()).decode()
        return cls(text.encode(), f"sha256-{digest}")

    def response(self, host: str, packed: bool) -> Any:
        policy = (f"default-src 'none'; script-src '{self.script}' '{_PROGRAM}' 'wasm-unsafe-eval' blob:; "
                  f"worker-src blob:; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; "
                  f"connect-src ws://{host} data: blob:; media-src data: blob:; "
                  "base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
        body = self.packed if packed else self.plain
        headers = {"Content-Type": "text/html; charset=utf-8", "Content-Security-Policy": policy}
        if packed:
            headers["Content-Encoding"] = "gzip"
        return _response(200, headers, body)


def _plain(status: int, why: str) -> Any:
    return _response(status, {"Content-Type": "text/plain; charset=utf-8",
                              "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'"},
                     f"facegen studio: {why}\n".encode())


def _moved(path: str) -> Any:
    return _response(302, {"Location": path, "Content-Type": "text/plain; charset=utf-8"}, b"")


def _response(status: int, headers: dict[str, str], body: bytes) -> Any:
    import http

    from websockets.datastructures import Headers
    from websockets.http11 import Response

    every = {**headers, "Content-Length": str(len(body)), "Cache-Control": "no-store", "Referrer-Policy": "no-referrer",
             "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY",
             "Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Resource-Policy": "same-origin",
             "Connection": "close"}
    return Response(status, http.HTTPStatus(status).phrase, Headers(every), body)


def _shown(text: str) -> str:
    """A stranger's text in one line of ours."""
    return ascii(text[:80])
