"""Where the studio listens: a socket of its own, so that a taken port is told of and nobody else gets in between."""

from __future__ import annotations

import errno
import os
import socket

from facegen.errors import InputError
from facegen.studio import guard

EVERYWHERE = ("0.0.0.0", "::", "")


def listen(host: str, port: int, tries: int = 1) -> socket.socket:
    """Return a listening socket at the first free of so many ports. Raises InputError for a host or port."""
    if not 0 <= port <= 65535:
        raise InputError(f"port: expected 0 to 65535, got {port}")
    try:
        family, _, _, _, address = socket.getaddrinfo(host or EVERYWHERE[0], None, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError):
        raise InputError(f"host: '{host}' is no address of this machine; expected for example 127.0.0.1") from None
    for number in range(port, min(port + tries, 65536)):
        found = socket.socket(family, socket.SOCK_STREAM)
        try:
            if os.name == "posix":      # elsewhere it would let two listen at one port
                found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            found.bind((address[0], number, *address[2:]))
            found.listen(128)
            return found
        except OSError as error:
            found.close()
            if error.errno == errno.EADDRINUSE:
                continue
            raise InputError(f"cannot listen at {host}:{number}: {error.strerror or error}") from None
    raise InputError(f"port: {port} is taken, by another studio perhaps; stop that, or choose another port"
                     if tries == 1 else f"port: none from {port} to {port + tries - 1} is free")


def names(host: str) -> list[str]:
    """Return the names under which a server at a host answers, as they stand in a URL, the best first."""
    if guard.is_loopback(host):
        own = _in_url(host)
        return [own, *(name for name in guard.LOOPBACK_NAMES if name != own)]
    if host in EVERYWHERE:
        return list(dict.fromkeys([socket.gethostname().casefold(), socket.getfqdn().casefold(),
                                   *guard.LOOPBACK_NAMES]))
    return [_in_url(host)]


def _in_url(host: str) -> str:
    return f"[{host}]" if ":" in host else host.casefold()
