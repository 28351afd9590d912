"""What the studio uses of viser that viser does not promise: all of it, and in this file only.

The version is pinned, and tests/studio/test_seam.py has a test of each use, to fail where a new viser is another.
"""

from __future__ import annotations

import contextlib
import re
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facegen.studio.gate import Element
from facegen.studio.needs import VERSION, import_viser

if TYPE_CHECKING:
    import socket

    import viser
    from websockets.asyncio.server import ServerConnection

    from facegen.studio.wire import UploadStart

PROTOCOL = f"viser-v{VERSION}"

_MARKS = re.compile(r"(<(?=[A-Za-z/!?])|!(?=\[))")


def page_file() -> Path:
    """Return where viser's page lies."""
    return Path(import_viser().__file__).parent / "client" / "build" / "index.html"


class _Ours(str):
    """The host given to viser: it tells our own call of `websockets.serve` from anybody else's."""

    __slots__ = ()


_patching = threading.RLock()


def start(listening: socket.socket, serve_page: Callable[..., Any], label: str, **options: Any) -> viser.ViserServer:
    """Start viser on a listening socket: it binds none itself.

    serve_page: called with each websocket and viser's own handler of it. options: of `websockets.serve`, over viser's.
    """
    import websockets.asyncio.server as module

    viser = import_viser()

    def serve(handler: Any, host: Any = None, port: Any = None, **others: Any) -> Any:
        if not isinstance(host, _Ours):
            return original(handler, host, port, **others)
        return original(lambda connection: serve_page(connection, handler), sock=listening, **{**others, **options})

    with _patching, _silent():
        original = module.serve
        module.serve = serve
        try:
            return viser.ViserServer(_Ours("127.0.0.1"), listening.getsockname()[1], label=label, verbose=False)
        finally:
            module.serve = original


def stop(server: viser.ViserServer) -> None:
    """Stop viser."""
    with _silent():
        server.stop()


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Drop what viser prints about itself."""
    import rich

    def say(*args: Any, **options: Any) -> None:
        if not sys._getframe(1).f_globals.get("__name__", "").startswith("viser."):
            original(*args, **options)

    with _patching:
        original = rich.print
        rich.print = say
        try:
            yield
        finally:
            rich.print = original


def connection_of(server: viser.ViserServer, client: viser.ClientHandle) -> ServerConnection | None:
    """Return the websocket of a page, None when it went."""
    return server._websock_server._live_connections.get(client.client_id)


def client_of(server: viser.ViserServer, connection: ServerConnection) -> viser.ClientHandle | None:
    """Return the page of a websocket, None before it said where its camera is."""
    for number, other in tuple(server._websock_server._live_connections.items()):
        if other is connection:
            return server._connected_clients.get(number)
    return None


def element(server: viser.ViserServer, client: viser.ClientHandle | None, uuid: str) -> Element | None:
    """Return what is known of an element of a page's panel, None where there is none."""
    import viser

    for gui in (client.gui, server.gui) if client is not None else ():
        handle = gui._gui_input_handle_from_uuid.get(uuid)
        if handle is not None and not handle._impl.removed:
            state, props = handle._impl, handle._impl.props
            if isinstance(handle, viser.GuiUploadButtonHandle):
                kinds = [kind.strip().lower() for kind in props.mime_type.split(",")]
                return Element(files=tuple(kinds) if all(kind.startswith(".") for kind in kinds) else ())
            return Element(state.value, getattr(props, "min", None), getattr(props, "max", None),
                           getattr(props, "options", None))
    return None


def end_upload(client: viser.ClientHandle, upload: UploadStart) -> None:
    """Have a page wait no longer for an upload that was refused, and say nothing of it."""
    from viser import _messages

    client._websock_connection.queue_message(_messages.FileTransferPartAck(
        upload.source_component_uuid, upload.transfer_uuid, transferred_bytes=0, total_bytes=0))
    client._websock_connection.queue_message(_messages.RemoveNotificationMessage(f"upload-{upload.transfer_uuid}"))


def only_words(client: viser.ClientHandle) -> None:
    """Have a page's Markdown hold neither HTML, which viser puts into the page as it is, nor pictures, whose files it
    reads: names and warnings come from strangers' files.

    An invisible joiner after the sign keeps both from being read as such, and shows the same in text and in code.
    """
    import viser

    class Words(viser.GuiMarkdownHandle):
        @property
        def content(self) -> str:
            return self._content

        @content.setter
        def content(self, content: str) -> None:
            viser.GuiMarkdownHandle.content.fset(self, _MARKS.sub("\\1\N{WORD JOINER}", content))
            self._content = content

    add = client.gui.add_markdown

    def add_markdown(content: str, **named: Any) -> viser.GuiMarkdownHandle:
        handle = add("", **named)
        handle.__class__ = Words
        handle.content = content
        return handle

    client.gui.add_markdown = add_markdown


def set_icon(button: viser.GuiButtonHandle, html: str) -> None:
    """Show HTML of our own on a button, where viser's ``icon`` knows only its own icons."""
    if getattr(button, "_icon_html", None) != html:
        button._icon_html = html


def refuse_share(server: viser.ViserServer, refuse: Callable[..., None]) -> None:
    """Take away every way by which a page or a caller makes viser open a tunnel to elsewhere."""
    from viser import _messages

    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)
    server.request_share_url = server.disconnect_share_url = refuse


def take_handlers(server: viser.ViserServer, submit: Callable[..., Any],
                  fault: Callable[[BaseException, viser.ClientHandle | None], None]) -> Callable[..., Any]:
    """Have viser hand handlers to ``submit(handler, *args)`` and not to its threads; return what starts a function on
    one of those. fault: told what anything else raised that viser would not tell of, and at which page."""
    pool, infra = server._thread_executor, server._websock_server
    run = pool.submit
    pool.submit = submit

    def guarded(handle: Callable[..., Any]) -> Callable[..., Any]:
        async def call(number: int, message: Any) -> None:
            try:
                await handle(number, message)
            except Exception as error:
                fault(error, server._connected_clients.get(number))

        return call

    infra._handle_incoming_message = guarded(infra._handle_incoming_message)

    @infra.on_client_connect
    def _(connection: Any) -> None:
        connection._handle_incoming_message = guarded(connection._handle_incoming_message)

    loop = infra._background_event_loop
    loop.call_soon_threadsafe(loop.set_exception_handler, lambda _, found: fault(
        found.get("exception") or RuntimeError(found["message"]), None))
    return run


def whose(handler: Any, args: tuple[Any, ...]) -> tuple[viser.ClientHandle | None, Any]:
    """Return at which page a handler is called, and what newest value it is told of: None where each call counts."""
    import viser

    about = args[0] if args else None
    if isinstance(about, viser.ClientHandle):
        return about, None
    if isinstance(about, viser.CameraHandle):
        return about.client, (handler, "camera")
    client, target = getattr(about, "client", None), getattr(about, "target", None)
    if isinstance(about, viser.GuiEvent):
        state = target._impl
        each = state.is_button or isinstance(target, viser.GuiUploadButtonHandle)
        return client, None if each else (handler, state.uuid)
    if getattr(about, "phase", None) == "update":
        return client, (handler, target.name)
    return client, None
