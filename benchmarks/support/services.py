"""A cluster of dask and an S3 server on this machine, as processes, for benchmarks and tests."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

HOST = "127.0.0.1"
_START_S = 60.0


class Cluster:
    """A scheduler and workers, each with a log in a folder; a context manager that ends them all."""

    def __init__(self, folder: Path, workers: int = 2, *, nanny: bool = False) -> None:
        self.port = free_port()
        self.address = f"tcp://{HOST}:{self.port}"
        self._folder = folder
        self._nanny = nanny
        self._scheduler: subprocess.Popen[bytes] | None = None
        self.workers: list[subprocess.Popen[bytes]] = []
        self.start_scheduler()
        for _ in range(workers):
            self.start_worker()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, where: TracebackType | None) -> None:
        self.kill_scheduler()
        for worker in self.workers:
            kill(worker)

    def start_scheduler(self, **environment: str) -> None:
        self._scheduler = self._started("scheduler", f"--host={HOST}", f"--port={self.port}", **environment)
        wait_for(self.port)

    def kill_scheduler(self) -> None:
        if self._scheduler is not None:
            kill(self._scheduler)

    def start_worker(self, **environment: str) -> subprocess.Popen[bytes]:
        options = ["--nthreads=1", f"--local-directory={self._folder}", "--nanny" if self._nanny else "--no-nanny"]
        self.workers.append(self._started("worker", self.address, *options, **environment))
        return self.workers[-1]

    def log(self) -> str:
        return "\n".join(path.read_text() for path in sorted(self._folder.glob("*.log")))

    def _started(self, what: str, *args: str, **environment: str) -> subprocess.Popen[bytes]:
        path = self._folder / f"{what}-{len(self.workers)}.log"
        with path.open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{what}", *args, "--no-dashboard"],
                stdout=log,
                stderr=log,
                start_new_session=True,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **environment},
            )


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process that leads a group, with all that it has started in it, as a machine that goes down does."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def free_port() -> int:
    with socket.socket() as free:
        free.bind((HOST, 0))
        return int(free.getsockname()[1])


def wait_for(port: int) -> None:
    end = time.monotonic() + _START_S
    while time.monotonic() < end:
        with socket.socket() as probe:
            if probe.connect_ex((HOST, port)) == 0:
                return
        time.sleep(0.1)
    raise TimeoutError(f"nothing listens on port {port}")


@contextmanager
def s3_server() -> Iterator[Mapping[str, str]]:
    """Run moto's S3 server; yield the environment variables by which it is found."""
    port = free_port()
    process = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-H", HOST, "-p", str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for(port)
        yield {
            "AWS_ACCESS_KEY_ID": "key",
            "AWS_SECRET_ACCESS_KEY": "very-secret",
            "AWS_ENDPOINT_URL": f"http://{HOST}:{port}",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
    finally:
        process.kill()
        process.wait()
