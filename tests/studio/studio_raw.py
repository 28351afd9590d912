"""viser's protocol without a browser, to say what no browser would: every header and message as one likes."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Mapping
from typing import Any

import msgspec
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

PROTOCOL = "viser-v1.1.1"
PATIENCE = 40.0         # seconds that an answer is waited for: the machine may be busy
CAMERA = {"type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 3.0], "fov": 0.8,
          "near": 0.01, "far": 1000.0, "image_height": 600, "image_width": 800, "look_at": [0.0, 0.0, 0.0],
          "up_direction": [0.0, 1.0, 0.0]}


def request(port: int, path: str | bytes = "/", headers: Mapping[str, str] | None = None, *, method: str = "GET",
            host: str | None = None) -> tuple[int, dict[str, str], bytes]:
    """Send one HTTP request byte for byte; return status, headers (lower case) and body."""
    path = path.encode() if isinstance(path, str) else path
    fields = {"Host": host or f"127.0.0.1:{port}", **(headers or {})}
    lines = b"".join(f"{name}: {value}\r\n".encode() for name, value in fields.items() if value is not None)
    with socket.create_connection(("127.0.0.1", port), timeout=20) as wire:
        wire.sendall(method.encode() + b" " + path + b" HTTP/1.1\r\n" + lines + b"\r\n")
        found = b""
        while chunk := wire.recv(1 << 16):
            found += chunk
    head, _, body = found.partition(b"\r\n\r\n")
    first, *rest = head.decode("latin-1").split("\r\n")
    return int(first.split()[1]), {name.lower(): value.strip() for name, _, value in
                                   (line.partition(":") for line in rest)}, body


class RawPage:
    """A page that is none: a websocket to a work."""

    def __init__(self, port: int, work: str, *, origin: str | None = "", headers: Mapping[str, str] | None = None,
                 path: str | None = None, protocol: str = PROTOCOL) -> None:
        self.port = port
        self.socket = connect(f"ws://127.0.0.1:{port}" + (path if path is not None else f"/w/{work}"),
                              origin=f"http://127.0.0.1:{port}" if origin == "" else origin,
                              additional_headers=dict(headers or {}), subprotocols=[protocol], compression=None,
                              max_size=None, open_timeout=20, close_timeout=1, proxy=None)

    def send(self, *messages: Mapping[str, Any]) -> None:
        """Send messages as viser's page does, one each."""
        for message in messages:
            self.send_bytes(msgspec.msgpack.encode(dict(message)))

    def send_bytes(self, data: bytes) -> None:
        """Send anything; as in a browser, nothing is said when the server has closed: what is received tells."""
        with contextlib.suppress(ConnectionClosed):
            self.socket.send(data)

    def receive(self, seconds: float = PATIENCE) -> list[dict[str, Any]]:
        """Return the next batch of messages from the server, an empty list when none comes."""
        try:
            raw = self.socket.recv(timeout=seconds)
        except TimeoutError:
            return []
        size = int.from_bytes(raw[8:16], "little")
        return msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(
            raw[16:16 + size], max_output_size=int.from_bytes(raw[:8], "little")))["messages"]

    def until(self, kind: str, seconds: float = PATIENCE, **fields: Any) -> dict[str, Any]:
        """Return the first message of a kind from the server whose fields are as told."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            for message in self.receive(left):
                if message["type"] == kind and all(message.get(name) == value for name, value in fields.items()):
                    return message
        raise AssertionError(f"no {kind} came within {seconds:.0f} s")

    def elements(self, count: int, seconds: float = PATIENCE) -> dict[str, str]:
        """Return the uuid of each of so many elements of the panel by its label."""
        end, found = time.monotonic() + seconds, {}
        while len(found) < count and (left := end - time.monotonic()) > 0:
            for message in self.receive(left):
                props = message.get("props")
                if message["type"].startswith("Gui") and isinstance(props, dict) and props.get("label"):
                    found[props["label"]] = message["uuid"]
        assert len(found) >= count, found
        return found

    def element(self, label: str) -> str:
        """Return the uuid of the panel's only element, which has this label."""
        return self.elements(1)[label]

    def begin(self) -> RawPage:
        """Say where the camera is: viser counts a page from then on."""
        self.send(CAMERA)
        return self

    def closed(self, seconds: float = PATIENCE) -> int | None:
        """Return the code with which the server closes the connection, None if it stays open."""
        end = time.monotonic() + seconds
        try:
            while (left := end - time.monotonic()) > 0:
                with contextlib.suppress(TimeoutError):
                    self.socket.recv(timeout=left)
        except ConnectionClosed as error:
            return error.rcvd.code if error.rcvd else 1006
        return None

    def vanish(self) -> None:
        """Go away without a word, as a browser that is killed."""
        with contextlib.suppress(OSError):
            self.socket.socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Go away."""
        self.socket.close()

    def __enter__(self) -> RawPage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
