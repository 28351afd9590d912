"""The only place that knows where ``tables/`` and ``meshes/`` lie: inside the wheel or in a checkout."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from facegen.errors import FileError


@cache
def _root() -> Path:
    package = Path(__file__).resolve().parent
    for root in (package / "_data", package.parent):
        if (root / "tables").is_dir() and (root / "meshes").is_dir():
            return root
    raise FileError(
        f"facegen's tables and meshes were not found beside {package}: the installation is incomplete; "
        "reinstall facegen"
    )


def tables_dir() -> Path:
    """Return the folder of the shipped tables."""
    return _root() / "tables"


def meshes_dir() -> Path:
    """Return the folder of the shipped meshes."""
    return _root() / "meshes"
