"""The same images by a cluster of two workers, from a bucket, with a worker that is killed in mid-run."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import fsspec

from benchmarks.support.services import Cluster, kill, s3_server

WORKERS = 2


def cluster_runs(folder: Path, command: Sequence[str], number: int) -> None:
    """Print what became of runs over the images in `folder`, each in a bucket and on the disk."""
    out = folder / "out"
    out.mkdir()
    given = ["-q", "--calib", str(folder / "camera.yaml"), "--target", str(folder / "target.yaml")]
    print(f"\n{number} images of 640 x 480 in a bucket of moto's S3 server, by a cluster of {WORKERS} workers:\n")
    print("| run | s | images a second | CPU ms an image, the command alone | table identical to the local one |")
    print("|---|---|---|---|---|")
    local = out / "local.csv"
    seconds, _ = timed([*command, str(folder), *given, "--jobs", str(WORKERS), "-o", str(local)], {})
    print(f"| local, `--jobs {WORKERS}` | {seconds:.1f} | {number / seconds:.1f} | | |", flush=True)
    with s3_server() as settings:
        fill("bucket", folder, settings)
        for name, source, settles, kills in (
            ("cluster, from the disk", str(folder), {}, False),
            ("cluster, from the bucket", "s3://bucket/imgs/", settings, False),
            ("the same, a worker killed half-way", "s3://bucket/imgs/", settings, True),
        ):
            logs = out / f"{len(list(out.iterdir()))}"
            logs.mkdir()
            with Cluster(logs, 0) as cluster:
                for _ in range(WORKERS):
                    cluster.start_worker(**settles)
                table = logs / "table.csv"
                given_too = [*given, "--cluster", cluster.address, "-o", str(table)]
                # First two images alone, by which the workers, and what measures there, have started.
                few = [str(folder / f"{each:06d}.png") for each in range(2)]
                _, start_up_s = timed([*command, *few, *given_too], {})
                kill_at = (cluster, table, number // 2) if kills else None
                seconds, cpu_s = timed([*command, source, *given_too], settles, kill_at)
            own_ms = 1e3 * (cpu_s - start_up_s) / (number - 2)
            same = "yes" if table.read_bytes() == local.read_bytes() else "NO"
            print(f"| {name} | {seconds:.1f} | {number / seconds:.1f} | {own_ms:.2f} | {same} |", flush=True)


def timed(
    command: Sequence[str], environment: Mapping[str, str], to_kill: tuple[Cluster, Path, int] | None = None
) -> tuple[float, float]:
    """Run a command; return how long it took, in s, and how much of a processor's time, without its children.

    When a table has so many images in its journal, the first worker of the cluster is killed.
    """
    start = time.perf_counter()
    with subprocess.Popen(command, env={**os.environ, **environment}) as process:
        if to_kill is not None:
            cluster, table, images = to_kill
            journal = table.with_name(f"{table.name}.journal")
            while not (journal.exists() and journal.read_bytes().count(b"\n") > images):
                time.sleep(0.02)
            kill(cluster.workers[0])
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{command} ended with {process.returncode}")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime


def fill(bucket: str, folder: Path, settings: Mapping[str, str]) -> None:
    files = fsspec.filesystem(
        "s3",
        key=settings["AWS_ACCESS_KEY_ID"],
        secret=settings["AWS_SECRET_ACCESS_KEY"],
        endpoint_url=settings["AWS_ENDPOINT_URL"],
    )
    files.mkdir(bucket)
    for path in sorted(folder.glob("*.png")):
        files.pipe_file(f"{bucket}/imgs/{path.name}", path.read_bytes())
