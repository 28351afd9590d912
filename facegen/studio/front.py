"""What the studio answers over HTTP: viser's one page, a move, or a sentence, with headers that keep it to itself."""

from __future__ import annotations

import base64
import gzip
import hashlib
import http
import re
from pathlib import Path
from typing import TYPE_CHECKING

from facegen.errors import FacegenError

if TYPE_CHECKING:
    from websockets.http11 import Response

TITLE = "facegen studio"
# viser's page unpacks its program and puts it in as one script: of viser 1.1.1 it is this one, and no other may run.
_PROGRAM = "sha256-o/BTEGoB4UnTxqb+3RxwUFQZkWXpqUxouHkbDNrAkqE="
_NOTHING = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
_ALWAYS = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff",
           "X-Frame-Options": "DENY", "Cross-Origin-Opener-Policy": "same-origin",
           "Cross-Origin-Resource-Policy": "same-origin", "Connection": "close"}


class Page:
    """viser's page under our title. It is one file; its policy lets it load no other, and speak to us only."""

    def __init__(self, path: Path) -> None:
        """Read it. Raises FacegenError where viser's page is not what the studio knows."""
        try:
            text = path.read_text("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise FacegenError(f"viser's page cannot be read: {error}; install viser again") from None
        scripts = re.findall(r"<script[^>]*>(.*?)</script>", text, re.S)
        if len(scripts) != 1 or text.count("<title>Viser</title>") != 1:
            raise FacegenError(f"{path}: is not the page of the viser that the studio needs; install viser again")
        self.plain = text.replace("<title>Viser</title>", f"<title>{TITLE}</title>").encode()
        self.packed = gzip.compress(self.plain, 6)
        self.script = f"sha256-{base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()}"

    def policy(self, host: str) -> str:
        """Return the Content-Security-Policy of the page as it is seen under a host, ``name:port``."""
        return (f"{_NOTHING}; script-src '{self.script}' '{_PROGRAM}' 'wasm-unsafe-eval' blob:; worker-src blob:; "
                f"style-src 'unsafe-inline'; img-src data: blob:; font-src data:; media-src data: blob:; "
                f"connect-src ws://{host} data: blob:")

    def answer(self, host: str, packed: bool) -> Response:
        """Return the page; ``packed`` where the browser can unpack it."""
        headers = {"Content-Type": "text/html; charset=utf-8", "Content-Security-Policy": self.policy(host)}
        if packed:
            headers["Content-Encoding"] = "gzip"
        return _response(200, headers, self.packed if packed else self.plain)


def sentence(status: int, text: str) -> Response:
    """Return a plain page with a sentence for a person."""
    return _response(status, {"Content-Type": "text/plain; charset=utf-8", "Content-Security-Policy": _NOTHING},
                     f"facegen studio: {text}\n".encode())


def moved(path: str) -> Response:
    """Send the browser to another path of ours."""
    return _response(302, {"Location": path, "Content-Security-Policy": _NOTHING}, b"")


def welcome(path: str, cookie: str) -> Response:
    """Give the browser a cookie, and send it to a path without the token.

    By a page and not by a status: of a link on another site's page the browser would go there without the cookie.
    """
    body = f'<!doctype html><title>{TITLE}</title><meta http-equiv="refresh" content="0; url={path}">'
    return _response(200, {"Content-Type": "text/html; charset=utf-8", "Content-Security-Policy": _NOTHING,
                           "Set-Cookie": f"{cookie}; HttpOnly; SameSite=Strict; Path=/"}, body.encode())


def _response(status: int, headers: dict[str, str], body: bytes) -> Response:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    every = {**headers, "Content-Length": str(len(body)), **_ALWAYS}
    return Response(status, http.HTTPStatus(status).phrase, Headers(every), body)
