"""Text files of unknown make as lines."""

from __future__ import annotations


def lines_of(raw: bytes) -> list[str]:
    """Return the lines of a text, whatever its line ends; UTF-8, or Latin-1 where it is none."""
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
