"""The studio's server: viser's page and websocket, behind guards, with a work to each page.

viser 1.1.1 binds every interface, takes any Host and Origin, tells a page's wish to share to a server elsewhere, and
trusts what a page says. What stands between is called from here.
"""

from __future__ import annotations

import logging
import re
import secrets
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facegen.errors import FacegenError, InputError
from facegen.studio import front, guard
from facegen.studio.limits import Limits
from facegen.studio.listening import EVERYWHERE, listen, names
from facegen.studio.needs import VERSION, import_viser
from facegen.studio.turns import Turns

if TYPE_CHECKING:
    import viser
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

    from facegen.studio.gate import Element
    from facegen.studio.wire import Refused

log = logging.getLogger("facegen.studio")

PORTS = 100             # tried one after another where another port will do
ID_BYTES = 24           # 192 bits: nobody guesses a work
_REFUSED = 50           # messages of one page, after which it is sent away: none of viser's page is refused so often
_TOLD = 5               # of them have a line of their own
_LINES, _WHILE = 20, 10.0       # lines about refused requests in so many seconds
_CLOSING = 1.0          # seconds for a page to say good-bye
_AGAIN = 5.0            # seconds before a page is told the same once more

OnPage = Callable[["viser.ClientHandle", str], Any]


class StudioServer:
    """A server of the studio's page.

    ::

        with StudioServer(port=0, on_page=lambda client, work: client.gui.add_slider("smile", 0, 1, 0.01, 0)) as server:
            print(server.url)

    host, port: where it listens; port 0 takes any that is free. exact: whether another port will do when it is taken.
    token: what a visitor must bring; None asks for none on this machine alone, and makes one for any other host.
    on_page, on_page_closed: called on another thread with the page (viser's ClientHandle) and the id of its work, when
    a page came and when it went; a page that is loaded again comes again with the same id.

    All that is called for one page, these two and the handlers of its elements, runs in the order in which it came, one
    after another; where several tell of newer values of one element, the newest runs. Long work belongs on a thread of
    its own. What such a handler raises is told on the page and in one line of the log ``facegen.studio``.

    Raises InputError for a host, port or token that cannot be, FacegenError without viser.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 8092, token: str | None = None,
                 limits: Limits | None = None, on_page: OnPage | None = None, on_page_closed: OnPage | None = None, *,
                 exact: bool = True) -> None:
        if token is not None and not re.fullmatch(r"[A-Za-z0-9._~-]{8,200}", token):
            raise InputError("token: expected 8 to 200 letters, digits or any of . _ ~ -")
        if token is None and not guard.is_loopback(host):
            token = secrets.token_urlsafe(ID_BYTES)
        self.host, self.port, self.token, self.limits = host, port, token, limits or Limits()
        self._asked, self._names = (port, 1 if exact else PORTS), names(host)
        self._on_page, self._on_page_closed = on_page, on_page_closed
        self._viser: viser.ViserServer | None = None
        self._works: dict[int, str] = {}        # of each page, by the number that viser gives it
        self._seen: set[str] = set()
        self._open: dict[ServerConnection, str] = {}        # the works of the pages that are connected
        self._refusals: list[float] = []        # when a line told of one
        self._last_told: dict[int, tuple[str, float]] = {}
        self._ready = False

    @property
    def url(self) -> str:
        """Where the studio is, with the token that lets in."""
        return self.url_at(self._names[0])

    def url_at(self, name: str) -> str:
        """Where the studio is under another name of this machine."""
        return f"http://{name}:{self.port}/" + (f"?token={self.token}" if self.token else "")

    @property
    def open_pages(self) -> int:
        """How many pages are open."""
        return len(self._open)

    @property
    def viser(self) -> viser.ViserServer:
        """viser's own server; InputError before `start`."""
        if self._viser is None:
            raise InputError("the server does not run: call start() first")
        return self._viser

    def start(self) -> StudioServer:
        """Listen, and return the server itself. Raises InputError for a host or port that cannot be had."""
        import_viser()
        from facegen.studio import seam
        from facegen.studio.connection import guarded
        from facegen.studio.gate import Budget

        self._seam, self.budget = seam, Budget(4 * self.limits.upload_bytes)
        self._page = front.Page(seam.page_file())
        listening = listen(self.host, *self._asked)
        self.port = listening.getsockname()[1]
        quiet = logging.getLogger("facegen.studio.websockets")
        quiet.disabled = True       # it has a traceback for every handshake that was refused; `answer` has a line
        try:
            self._viser = seam.start(listening, self.serve_page, front.TITLE, process_request=self.answer,
                                     max_size=self.limits.message_bytes, logger=quiet,
                                     create_connection=guarded(self), close_timeout=_CLOSING)
        except BaseException:
            listening.close()
            raise
        seam.refuse_share(self._viser, _refuse_share)
        self._turns = Turns(seam.take_handlers(self._viser, self._submit, self._fault))
        scene = self._viser.scene       # both cost a machine without a GPU its frames
        scene.configure_default_lights(cast_shadow=False)
        scene.configure_environment_map(None)
        self._viser.gui.configure_theme(show_share_button=False, show_logo=False)
        self._viser.on_client_connect(self._connected)
        self._viser.on_client_disconnect(self._disconnected)
        self._ready = True
        return self

    def stop(self) -> None:
        """Close every page and listen no more."""
        if self._viser is not None:
            self._ready = False
            self._seam.stop(self._viser)
            self._viser = None

    def __enter__(self) -> StudioServer:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    # Requests

    def answer(self, _: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a page, or refuse; None lets a websocket go on."""
        every = request.headers.get_all
        path, _, query = request.path.partition("?")
        websocket = bool(every("Upgrade"))
        refusal, host = self._refusal(every, query, websocket), every("Host")
        work = guard.work_of(path)
        if refusal is None and work is None and (path != "/" or websocket):
            refusal = guard.Refusal(404, "there is nothing here; the studio begins at /")
        if refusal is None and work is not None and (websocket or work not in self._open.values()):
            refusal = self._full(work)      # a page that is loaded again is still connected
        if refusal is not None:
            self._tell_of_refusal(f"{'a websocket to' if websocket else 'a request for'} {path[:80]!a}", refusal)
            return front.sentence(refusal.status, refusal.why)
        if websocket:
            return None
        if self.token and guard.is_token(guard.token_in_query(query), self.token):
            return front.welcome(path, f"{guard.cookie_name(self.port)}={self.token}")
        if query:       # viser's page would connect to where ?websocket= says
            return front.moved(path)
        if work is None:
            return front.moved(f"/w/{secrets.token_urlsafe(ID_BYTES)}")
        return self._page.answer(host[0].strip(), "gzip" in ",".join(every("Accept-Encoding")))

    def _refusal(self, every: guard.All, query: str, websocket: bool) -> guard.Refusal | None:
        allowed = self.token is None or any(
            guard.is_token(given, self.token)
            for given in (guard.token_in_query(query), *guard.tokens_in_headers(every, self.port)))
        refusal = (guard.check_host(every("Host"), self._names, self.port, addresses=self.host in EVERYWHERE)
                   or guard.check_origin(every, websocket=websocket, trusted=allowed and self.token is not None))
        if refusal is None and not allowed:
            refusal = guard.Refusal(403, "this studio wants its token: open the address that `facegen studio` printed, "
                                         "the one with ?token=")
        if refusal is None and not self._ready:
            refusal = guard.Refusal(503, "the studio is starting or ending; try again")
        return refusal

    def _tell_of_refusal(self, what: str, refusal: guard.Refusal) -> None:
        """Log it, but not more lines than a person reads: another site's page can ask all day."""
        now = time.monotonic()
        self._refusals = [when for when in self._refusals if now - when < _WHILE]
        if len(self._refusals) < _LINES:
            self._refusals.append(now)
            log.warning("refused %s: %s%s", what, refusal.why,
                        "; others are not told of for a while" if len(self._refusals) == _LINES else "")

    def _full(self, work: str) -> guard.Refusal | None:
        if len(self._open) >= self.limits.pages:
            return guard.Refusal(503, f"{self.limits.pages} pages are open, and no more may be; close one, then load "
                                      "this one again")
        if work not in self._seen and len(self._seen) >= self.limits.works:
            return guard.Refusal(503, f"this studio has seen {self.limits.works} works, and takes no other until it is "
                                      "started again")
        return None

    # Connections: these run on the thread of viser's event loop

    async def serve_page(self, connection: ServerConnection, viser_handler: Callable[..., Any]) -> None:
        """Hand a websocket to viser, where it speaks viser's protocol."""
        if connection.subprotocol != self._seam.PROTOCOL:
            await connection.close(1002, f"Version mismatch. Server: {VERSION}")
            return
        work = guard.work_of(connection.request.path.partition("?")[0])
        if self._full(work):        # others came in since the request was answered
            await connection.close(1013, "too many pages are open")
            return
        self._seen.add(work)
        self._open[connection] = work
        try:
            await viser_handler(connection)
        except Exception as error:
            log.error("a page was lost: %s", _told(error))
        finally:
            self._open.pop(connection, None)
            connection.gate.close()
            if connection.close_code == 1009:
                log.warning("a page was sent away: it sent more than %d bytes at once", self.limits.message_bytes)

    async def refuse(self, connection: ServerConnection, refused: Refused, upload: Any = None) -> None:
        """Tell that a message was refused, and send a page away that goes on and on."""
        connection.refused += refused.counts
        if refused.counts and connection.refused <= _TOLD:
            log.warning("refused a message of a page: %s", refused)
        client = self._seam.client_of(self._viser, connection) if self._viser is not None else None
        if client is not None and refused.tell:
            if upload is not None:
                self._seam.end_upload(client, upload)
            self._notify(client, "This file was not opened", refused.tell)
        if refused.closes or connection.refused >= _REFUSED:
            log.warning("a page was sent away: it sent what viser's page does not")
            connection.away = True
            await connection.close(1008, "unexpected messages")

    def element(self, connection: ServerConnection, uuid: str) -> Element | None:
        """Return what is known of an element of a page's panel."""
        viser = self._viser
        return None if viser is None else self._seam.element(viser, self._seam.client_of(viser, connection), uuid)

    # Handlers

    def _submit(self, handler: Callable[..., Any], *args: Any) -> Future[Any]:
        """Have a handler run when it is its page's turn."""
        client, latest = self._seam.whose(handler, args)
        number = getattr(client, "client_id", None)
        if handler == self._disconnected:
            self._turns.clear(number)
        found = self._turns.submit(number, lambda: self._guarded(handler, args, client), latest)
        if found is None:
            log.warning("a handler was left out: its page has too many waiting")
            found = Future()
            found.set_result(None)
        return found

    def _guarded(self, handler: Callable[..., Any], args: tuple[Any, ...], client: viser.ClientHandle | None) -> None:
        try:
            handler(*args)
        except Exception as error:
            self._fault(error, client)

    def _fault(self, error: BaseException, client: viser.ClientHandle | None) -> None:
        """Tell of what a handler raised: what was given wrong to the person, a fault of ours to both."""
        if not isinstance(error, InputError):
            log.error("a handler failed: %s", _told(error))
            log.debug("the whole of it", exc_info=error)
        if client is not None:
            if isinstance(error, FacegenError):
                self._notify(client, "That did not work", str(error))
            else:
                self._notify(client, "A fault of facegen's own", f"{type(error).__name__}: {error} - please report it.")

    def _notify(self, client: viser.ClientHandle, title: str, text: str) -> None:
        """Tell the person at a page, not the same again and again."""
        now = time.monotonic()
        said, when = self._last_told.get(client.client_id, ("", 0.0))
        if said != text or now - when > _AGAIN:
            self._last_told[client.client_id] = (text, now)
            client.add_notification(title, text[:1000], color="red", auto_close_seconds=20.0)

    def _connected(self, client: viser.ClientHandle) -> None:
        connection = self._seam.connection_of(self._viser, client)
        if connection is None:      # it went before it came
            return
        work = self._works[client.client_id] = guard.work_of(connection.request.path.partition("?")[0])
        self._seam.only_words(client)
        if self._on_page is not None:
            self._on_page(client, work)

    def _disconnected(self, client: viser.ClientHandle) -> None:
        self._last_told.pop(client.client_id, None)
        work = self._works.pop(client.client_id, None)
        if work is not None and self._on_page_closed is not None:
            self._on_page_closed(client, work)


def _refuse_share(*_: Any, **__: Any) -> None:
    log.warning("refused to share the studio: nothing of it leaves this machine")


def _told(error: BaseException) -> str:
    """An error in one line, with the place where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:300]}{place}"
