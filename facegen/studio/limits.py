"""What one studio takes: how many pages, how large, how fast."""

from __future__ import annotations

from dataclasses import dataclass

MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class Limits:
    """The bounds of one server; every one of them is refused or slowed with a line that says so.

    pages: pages open at once. works: different works seen by one server. message_bytes: one message of a page; an
    upload comes in parts of half a mebibyte. file_bytes: one uploaded file; data_bytes: one of YAML or JSON. uploads,
    upload_bytes: uploads of one page under way. messages: messages a second of one page, more are slowed. text:
    characters of one text of a page. habits: of a person's table, expressions, words and units. items: keys and events
    of a clip. triangles: of an opened avatar. recorded_seconds, frames, numbers: of an opened
    recording, as long as it lasts and as much as it holds. read_seconds, read_bytes: what reading an avatar or a
    recording may take. search_seconds: for looking for a face on an avatar. export_bytes: of pictures that lie on the
    disk until a film is whole. download_bytes: of one file that is sent to a browser, which holds it in memory until
    all is there.
    """

    pages: int = 16
    works: int = 256
    message_bytes: int = 4 * MEBIBYTE
    file_bytes: int = 64 * MEBIBYTE
    data_bytes: int = MEBIBYTE // 2
    upload_bytes: int = 128 * MEBIBYTE
    uploads: int = 4
    messages: float = 240.0
    text: int = 200_000
    habits: int = 1000
    items: int = 2000
    triangles: int = 400_000        # an avatar for games has a tenth
    recorded_seconds: float = 6 * 3600.0
    frames: int = 500_000
    numbers: int = 30_000_000
    read_seconds: float = 60.0
    read_bytes: int = 2048 * MEBIBYTE
    search_seconds: float = 300.0
    export_bytes: int = 4096 * MEBIBYTE
    download_bytes: int = 512 * MEBIBYTE


LIMITS = Limits()
"""What is taken where nobody says otherwise."""
