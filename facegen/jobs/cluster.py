"""A cluster of machines through dask.distributed. The only file that imports it."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from facegen.errors import InputError

WAIT = 5.0
"""Seconds to wait for a scheduler, and for its first worker."""

_ADDRESS = re.compile(r"(?:(?P<by>tcp|tls|ucx|ucxx|ws|wss)://)?\[?(?P<host>[^\s/\[\]]+)\]?:(?P<port>[0-9]{1,5})/?")
_LAST_PORT = 65_535
_AGAIN = 0.1        # seconds between two looks for a scheduler
_RECOUNT = 5.0      # seconds after which workers are counted again: they may join and leave while the work runs


def connect(address: str, *, wait: float | None = None) -> Cluster:
    """Return the workers of the dask scheduler at an address such as ``tcp://10.0.0.7:8786``.

    wait: seconds for the scheduler to answer, and for its first worker to come; None is `WAIT`. Raises InputError if
    distributed is not installed, nothing answers, or no worker is there.
    """
    wait = WAIT if wait is None else wait
    found = _ADDRESS.fullmatch(address)
    if not found or int(found["port"]) > _LAST_PORT:
        raise InputError(f"scheduler: expected an address such as tcp://10.0.0.7:8786, got {address!r}")
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("scheduler: a cluster needs dask.distributed, which is not installed: "
                         "pip install \"facegen[cluster]\"") from error
    silent = (f"scheduler: nothing answers at {address} (waited {wait:g} s); `dask scheduler` starts one and prints "
              "its address")
    # A client that finds nobody stays half made; thrown away at a bad moment, it waits for itself for ever.
    if found["by"] in (None, "tcp", "tls") and not _answers(found["host"], int(found["port"]), wait):
        raise InputError(silent)
    try:
        client = Client(address, timeout=wait, set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise InputError(silent) from error
    except (ValueError, TypeError) as error:
        raise InputError(f"scheduler: expected an address such as tcp://10.0.0.7:8786, got {address!r}: {error}"
                         ) from error
    try:
        client.wait_for_workers(1, timeout=wait)
    except TimeoutError as error:
        client.close()
        raise InputError(f"scheduler: {address} has no workers (waited {wait:g} s); `dask worker {address}` starts one"
                         ) from error
    return Cluster(client)


def _answers(host: str, port: int, wait: float) -> bool:
    """Return whether anything listens there within so many seconds."""
    deadline = time.monotonic() + wait
    while (left := deadline - time.monotonic()) > 0:
        try:
            socket.create_connection((host, port), timeout=left).close()
        except OSError:
            time.sleep(min(_AGAIN, left))
        else:
            return True
    return False


class Cluster:
    """The workers of a dask cluster, as a crew."""

    breaks = False          # the scheduler itself hands out again what a dead worker had in hand ...
    renewable = True
    deaths_a_loss = 2       # ... and reports a loss when that has happened several times

    def __init__(self, client: Any) -> None:
        from distributed import KilledWorker

        self.losses = (KilledWorker,)
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._slots, self._counted = 0, float("-inf")

    @property
    def slots(self) -> int:
        """Tasks that all present workers can do at once."""
        if time.monotonic() - self._counted > _RECOUNT:
            self._slots = max(1, sum(self._client.nthreads().values()))
            self._counted = time.monotonic()
        return self._slots

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future:
        """Hand out one chunk."""
        return self._executor.submit(work, *arguments)

    def renew(self) -> None:
        """Do nothing: the cluster looks after its workers."""

    def stop(self) -> None:
        """Take back what no worker has begun."""
        self._executor.shutdown(wait=False)

    def close(self) -> None:
        """Let go of the cluster, which stays as it was."""
        self._client.close()
