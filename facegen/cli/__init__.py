"""The command line; nothing heavy is imported before a command needs it."""

from __future__ import annotations

from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0 done, 1 stopped or a fault of ours, 2 wrong input."""
    from facegen.cli.app import run

    return run(argv)


__all__ = ["main"]
