"""A dask scheduler and workers in processes of their own, as a laboratory starts them."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from frictus_service.processes import free_port

STARTS_S = 90.0


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Start them, and yield the scheduler's address once all are there.

    Parameters
    ----------
    workers : int
        Of one thread each.
    """
    address = f"tcp://127.0.0.1:{free_port()}"
    port = address.rpartition(":")[2]
    dask = [sys.executable, "-m", "dask"]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    # They end by themselves, should this process be killed.
    scheduler = ["scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"]
    scheduler += ["--idle-timeout", "10 minutes"]
    worker = ["worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    worker += ["--death-timeout", f"{STARTS_S:g}"]
    running = [
        subprocess.Popen([*dask, *words], **quiet) for words in (scheduler, *workers * [worker])
    ]
    try:
        distributed: Any = import_module("distributed")
        with distributed.Client(address, timeout=STARTS_S, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=STARTS_S)
        yield address
    finally:
        for process in running:
            process.kill()  # a worker that is only asked to end finishes its study first
        for process in running:
            process.wait()
