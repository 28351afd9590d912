"""What the studio needs beside facegen, and what to do where it is not there."""

from __future__ import annotations

from types import ModuleType

from facegen.errors import FacegenError

VERSION = "1.1.1"       # the studio's guards know this viser, and no other
INSTALL = 'pip install "facegen[studio]"'


def import_viser() -> ModuleType:
    """Return viser. Raises FacegenError that names the command to install it."""
    try:
        import viser
    except ImportError as error:
        raise FacegenError(f"the studio needs viser ({error}); install it with: {INSTALL}") from None
    if viser.__version__ != VERSION:
        raise FacegenError(f"the studio needs viser {VERSION}, found {viser.__version__}; install it with: {INSTALL}")
    return viser
