"""Who may speak to the studio: what a request's own words tell of it, before anything else is done.

Functions of headers only. A page of somebody else's, open in the same browser, can send requests to this machine: its
requests carry a foreign Origin, or, where a name of its own was pointed here (DNS rebinding), a foreign Host.
"""

from __future__ import annotations

import hmac
import ipaddress
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

WORK_ID = re.compile(r"[A-Za-z0-9_-]{16,64}")
_WORK_PATH = re.compile(rf"/w/({WORK_ID.pattern})")
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "[::1]")

All = Callable[[str], Sequence[str]]        # a header's name -> every value that came with it


@dataclass(frozen=True)
class Refusal:
    """A request that is not served: the HTTP status, and a sentence for a person."""

    status: int
    why: str


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address; a name other than localhost is taken to be reached by others."""
    if host.casefold() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def check_host(found: Sequence[str], names: Sequence[str], port: int, *, addresses: bool = False) -> Refusal | None:
    """Refuse a Host that is none of ours.

    names: as they stand in a URL, IPv6 in brackets. addresses: take any IP address too, for a server that is bound to
    all of a machine's: DNS rebinding needs a name.
    """
    if len(found) != 1:
        return Refusal(400, "expected one Host header")
    host = found[0].strip().casefold()
    name, colon, number = host.rpartition(":")
    if not colon or number.endswith("]"):
        name, number = host, "80"
    if number == str(port):
        if name in [one.casefold() for one in names]:
            return None
        if addresses and _is_address(name):
            return None
    return Refusal(403, f"this studio answers only under its own address, http://{names[0]}:{port}/")


def _is_address(name: str) -> bool:
    if "%" in name:         # after it anything may stand, and a Host is repeated in a header of ours
        return False
    try:
        ipaddress.ip_address(name[1:-1] if name.startswith("[") and name.endswith("]") else name)
    except ValueError:
        return False
    return True


def check_origin(every: All, *, websocket: bool, trusted: bool = False) -> Refusal | None:
    """Refuse what another site's page sent. Host is checked before.

    A browser gives every websocket an Origin, so that one without comes from a program: it is let in if it is trusted,
    that is, if it carries the token.
    """
    origins, host = every("Origin"), every("Host")
    if len(origins) > 1:
        return Refusal(400, "expected one Origin header")
    if origins:
        parts = urlsplit(origins[0].strip().casefold())
        if parts.scheme != "http" or parts.netloc != host[0].strip().casefold() or parts.path or parts.query:
            return Refusal(403, "pages of other sites are refused")
    elif websocket and not trusted:
        return Refusal(403, "a websocket without an Origin is refused; a program needs the token")
    site = [value.casefold() for value in every("Sec-Fetch-Site")]
    mode = [value.casefold() for value in every("Sec-Fetch-Mode")]
    if any(value in ("cross-site", "same-site") for value in site) and "navigate" not in mode:
        return Refusal(403, "pages of other sites are refused")
    return None


def cookie_name(port: int) -> str:
    """The cookie of one studio: cookies know no port."""
    return f"facegen-studio-{port}"


def token_in_query(query: str) -> str | None:
    """Return the token in a URL, ``?token=...``."""
    return next(iter(parse_qs(query).get("token", [])), None)


def tokens_in_headers(every: All, port: int) -> list[str]:
    """Return the tokens in a request's headers: the cookie, and ``Authorization: Bearer``."""
    found = []
    for value in every("Authorization"):
        kind, _, rest = value.strip().partition(" ")
        if kind.casefold() == "bearer":
            found.append(rest.strip())
    for pair in ";".join(every("Cookie")).split(";"):
        name, _, value = pair.strip().partition("=")
        if name == cookie_name(port):
            found.append(value)
    return found


def is_token(given: str | None, token: str) -> bool:
    """Compare without telling by the time how much of it was right."""
    return given is not None and hmac.compare_digest(given.encode("utf-8", "replace"), token.encode("utf-8"))


def work_of(path: str) -> str | None:
    """Return the id in ``/w/<id>``, None for any other path. Nothing is decoded: an id needs no escapes."""
    found = _WORK_PATH.fullmatch(path)
    return found[1] if found else None
