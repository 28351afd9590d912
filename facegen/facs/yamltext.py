"""Plain data as YAML text that `facegen.facs.yamlfile` reads back the same: blocks outside, short lines within."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping

from facegen.errors import InputError, TableError
from facegen.facs.yamlfile import parse_yaml

WIDTH = 110
"""A value that fits in a line of so many characters stands in one."""

_STEP = "  "
_PLAIN_KEY = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_NO_KEYS = ("true", "false", "null", "yes", "no", "on", "off", "y", "n")       # other readers take them for flags


def yaml_text(data: Mapping[str, object]) -> str:
    """Return plain data - mappings, lists, texts, numbers, flags - as the text of a file.

    Raises InputError for what YAML cannot hold, such as a text with control characters.
    """
    text = "".join(f"{line}\n" for key, value in data.items() for line in entry_lines(key, value))
    try:
        same = parse_yaml(text, "text") == _plain(data)
    except (TableError, UnicodeError):
        same = False
    if not same:
        raise InputError("data: cannot be written as YAML: a text holds characters that no text file can")
    return text


def entry_lines(key: str, value: object, indent: str = "") -> list[str]:
    """Return the lines of one key of a mapping: in one line if it fits and holds no further mapping, else a block."""
    head = f"{indent}{_key(key)}:"
    short = f"{head} {_flow(value)}"
    nested = isinstance(value, Mapping) and any(isinstance(one, Mapping) for one in value.values())
    if not isinstance(value, Mapping) or not value or (len(short) <= WIDTH and not nested):
        return [short]
    return [head] + [line for k, v in value.items() for line in entry_lines(k, v, indent + _STEP)]


def _plain(value: object) -> object:
    """Return data as they are read: keys are text, lists are lists."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, (list, tuple)) else value


def _key(key: str) -> str:
    key = str(key)
    return key if _PLAIN_KEY.fullmatch(key) and key.lower() not in _NO_KEYS else json.dumps(key, ensure_ascii=False)


def _flow(value: object) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)}: {_flow(one)}" for key, one in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, (int, float)):
        if not math.isfinite(value):
            raise InputError(f"data: expected finite numbers, got {value}")
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    raise InputError(f"data: expected plain data, got {type(value).__name__}")
