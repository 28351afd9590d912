"""A page's connection: each message is checked before it is received."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from websockets.asyncio.server import ServerConnection
from websockets.protocol import State

from facegen.studio.gate import Gate
from facegen.studio.wire import Refused, UploadStart, read

if TYPE_CHECKING:
    from facegen.studio.server import StudioServer

_SOCKETS = 128          # connections at once that are no page: a browser needs two


def guarded(server: StudioServer) -> type[ServerConnection]:
    """Return websockets' connection for a server, behind a gate."""
    held: set[ServerConnection] = set()

    class Guarded(ServerConnection):
        """A connection. gate: what its page sent so far. refused: how much of that no honest page sends. away: whether
        it was sent away for that."""

        def __init__(self, *args: Any, **options: Any) -> None:
            super().__init__(*args, **options)
            self.gate = Gate(server.limits, lambda uuid: server.element(self, uuid), server.budget)
            self.refused, self.away = 0, False

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            held.add(self)
            if len(held) - server.open_pages > _SOCKETS:
                transport.abort()

        def connection_lost(self, exc: Exception | None) -> None:
            held.discard(self)
            super().connection_lost(exc)

        async def recv(self, decode: bool | None = None) -> Any:
            while True:
                raw = await super().recv(decode)
                pause = self.gate.wait(len(raw))
                if self.away or (pause > 0 and self.state is not State.OPEN):
                    continue        # what is left of a flood is thrown away
                if pause > 0:       # no more is read meanwhile, so that it is the sender who waits
                    await asyncio.sleep(pause)
                try:
                    self.gate.check(raw)
                except Refused as refused:
                    found = read(raw) if refused.tell else None
                    await server.refuse(self, refused, found if isinstance(found, UploadStart) else None)
                else:
                    return raw

    return Guarded
