"""A command run inside the process: quick, and with the exit code, stdout and stderr of the real one."""

from __future__ import annotations

import pytest

from facegen.cli import main


@pytest.fixture
def run(capsys):
    def command(*argv: object) -> tuple[int, str, str]:
        code = main([str(word) for word in argv])
        out, err = capsys.readouterr()
        return code, out, err

    return command
