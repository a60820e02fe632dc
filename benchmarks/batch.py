"""Many images by worker processes: how fast, in how much memory, and what is left of a run that is killed.

python -m benchmarks.batch [--images 1000] [--repeats 3] [--memory 1000 20000] [--kills 50] [--cluster 400]

The last needs `pip install '.[test-cluster]'`; 0, or no number, leaves a part out.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from circlepose.camera.camera import Camera
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene

COMMAND = [str(Path(sys.executable).with_name("circlepose")), "estimate"]
JOBS = 2
DISTINCT = 20
RADIUS_MM = 60.0


def write_images(folder: Path, number: int, size: tuple[int, int], discs: int = DISTINCT) -> Path:
    """Make a folder of `number` names that lead to `DISTINCT` images, so many of `discs`, the others empty."""
    folder.mkdir(parents=True)
    (folder / "stored").mkdir()
    width, height = size
    focal = 0.94 * width
    matrix = [[focal, 0.0, (width - 1) / 2.0], [0.0, focal, (height - 1) / 2.0], [0.0, 0.0, 1.0]]
    camera = Camera.create(matrix, (), size)
    (folder / "camera.yaml").write_text(
        f"fx: {focal}\nfy: {focal}\ncx: {(width - 1) / 2}\ncy: {(height - 1) / 2}\nimage_size: [{width}, {height}]\n"
    )
    (folder / "target.yaml").write_text(f"radius_mm: {RADIUS_MM}\n")
    rng = np.random.default_rng(7)
    for each in range(DISTINCT):
        tilt = np.radians(rng.uniform(10.0, 70.0))
        center = np.array([*rng.uniform(-60.0, 60.0, 2), rng.uniform(500.0, 1200.0)])
        disc = Disc(center, np.array([0.0, np.sin(tilt), -np.cos(tilt)]), RADIUS_MM, Paint(40.0))
        targets = (disc,) if each < discs else ()
        scene = Scene(camera, targets, Paint(200.0), blur_px=0.7, noise_levels=2.0, noise_seed=each)
        cv2.imwrite(str(folder / "stored" / f"{each}.png"), render(scene))
    for each in range(number):
        (folder / f"{each:06d}.png").symlink_to(folder / "stored" / f"{each % DISTINCT}.png")
    return folder


def decode(paths: list[str]) -> None:
    cv2.setNumThreads(1)
    for path in paths:
        cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)


def seconds_to_decode(folder: Path) -> float:
    paths = [str(path) for path in folder.glob("*.png")]
    context = multiprocessing.get_context("spawn")
    workers = [context.Process(target=decode, args=(paths[job::JOBS],)) for job in range(JOBS)]
    start = time.perf_counter()
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return time.perf_counter() - start


def cpu_of_children_s() -> float:
    """Return the processor time of all children that have ended, and theirs."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def throughput(folder: Path, number: int, repeats: int) -> None:
    print(f"{number} images of 1280 x 960 (PNG), times with start-up of all processes, the runs in turn:\n")
    columns = ["turn", "1 job, images a second", "2 jobs", "2 processes that only decode", "2 jobs / 1 job"]
    columns += ["2 jobs / decoding", "2 jobs, CPU ms an image", "decoding, CPU ms an image"]
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    for turn in range(1, repeats + 1):
        rates, cpu = {}, {}
        for name in ("1 job", "2 jobs", "decoding"):
            start, before = time.perf_counter(), cpu_of_children_s()
            if name == "decoding":
                seconds_to_decode(folder)
            else:
                command = [*COMMAND, str(folder), "-q", "--jobs", name[0], "-o", str(folder / "out.csv")]
                subprocess.run(command, check=True)
            rates[name] = number / (time.perf_counter() - start)
            cpu[name] = 1e3 * (cpu_of_children_s() - before) / number
        one, two, decoding = rates.values()
        print(
            f"| {turn} | {one:.1f} | {two:.1f} | {decoding:.1f} | {two / one:.2f} | {two / decoding:.2f} | "
            f"{cpu['2 jobs']:.1f} | {cpu['decoding']:.1f} |",
            flush=True,
        )


def children_of(pid: int) -> list[int]:
    try:
        return [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def peak_mb(pid: int, *, of_worker: bool = False) -> float:
    try:
        status = Path(f"/proc/{pid}/status").read_text()
        # What is about to become a worker is for a moment a copy of its parent.
        if of_worker and b"spawn_main" not in Path(f"/proc/{pid}/cmdline").read_bytes():
            return 0.0
    except OSError:
        return 0.0
    return next((float(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmHWM")), 0.0)


def memory(folder: Path, counts: list[int]) -> None:
    print(f"\nPeak of resident memory, `--jobs {JOBS}`, images of 160 x 120, a disc in one of {DISTINCT}:\n")
    print("| images | parent, MB | largest worker, MB |\n|---|---|---|")
    for number in counts:
        images = write_images(folder / str(number), number, (160, 120), discs=1)
        command = [*COMMAND, str(images), "-q", "--jobs", str(JOBS), "-o", str(images / "out.csv")]
        parent = worker = 0.0
        with subprocess.Popen(command) as process:
            while process.poll() is None:
                parent = max(parent, peak_mb(process.pid))
                worker = max([worker, *(peak_mb(each, of_worker=True) for each in children_of(process.pid))])
                time.sleep(0.1)
        print(f"| {number} | {parent:.1f} | {worker:.1f} |")


def killed_run(command: list[str], out: Path, rng: random.Random, longest_s: float) -> tuple[bool, int]:
    """Kill a run, parent or worker, at random instants until it comes to its end; return what and how often."""
    kills_parent = rng.random() < 0.5
    kills = 0
    while True:
        resume = ["--resume"] if kills else []
        with subprocess.Popen([*command, "-o", str(out), *resume]) as process:
            try:
                process.wait(rng.uniform(0.0, longest_s) if kills < 3 else None)
            except subprocess.TimeoutExpired:
                # The first child only keeps track of resources.
                workers = children_of(process.pid)[1:]
                victim = process.pid if kills_parent else rng.choice(workers or [process.pid])
                try:
                    os.kill(victim, signal.SIGKILL)
                except ProcessLookupError:
                    continue
                finally:
                    kills += 1
            if process.wait() == 0 and kills:
                return kills_parent, kills


def kills(folder: Path, number: int, seed: int) -> None:
    command = [*COMMAND, str(folder), "-q", "--jobs", str(JOBS)]
    start = time.perf_counter()
    subprocess.run([*command, "-o", str(folder / "whole.csv")], check=True)
    longest_s = time.perf_counter() - start
    whole = (folder / "whole.csv").read_bytes()
    rng = random.Random(seed)
    same = {True: 0, False: 0}
    runs = {True: 0, False: 0}
    signals = {True: 0, False: 0}
    older = whole.replace(b"chen-huang", b"an older run")
    for turn in range(number):
        out = folder / "killed.csv"
        out.unlink(missing_ok=True)
        if turn % 2:
            # A complete table of an older run, which stays until the new one is complete.
            out.write_bytes(older)
        parent, times = killed_run(command, out, rng, longest_s)
        runs[parent] += 1
        signals[parent] += times
        same[parent] += out.read_bytes() == whole and not out.with_name("killed.csv.journal").exists()
    print(f"\nRuns killed by SIGKILL at random instants, up to three times each, and resumed (seed {seed}):\n")
    print("| killed | runs | kills | table identical to the undisturbed one |\n|---|---|---|---|")
    for parent, name in ((True, "the parent"), (False, "a worker")):
        print(f"| {name} | {runs[parent]} | {signals[parent]} | {same[parent]} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=1000, help="for the throughput; 0 leaves it out")
    parser.add_argument("--repeats", type=int, default=3, help="of the throughput")
    parser.add_argument("--memory", type=int, nargs="*", default=[1000, 20000], help="numbers of images")
    parser.add_argument("--kills", type=int, default=50, help="runs to kill; 0 leaves it out")
    parser.add_argument("--cluster", type=int, default=400, help="images for a cluster; 0 leaves it out")
    parser.add_argument("--seed", type=int, default=1999)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        if arguments.images:
            images = write_images(place / "throughput", arguments.images, (1280, 960))
            throughput(images, arguments.images, arguments.repeats)
        if arguments.memory:
            memory(place / "memory", arguments.memory)
        if arguments.kills:
            kills(write_images(place / "kills", 40, (320, 240)), arguments.kills, arguments.seed)
        if arguments.cluster:
            from benchmarks.support.cluster_runs import cluster_runs

            cluster_runs(write_images(place / "cluster", arguments.cluster, (640, 480)), COMMAND, arguments.cluster)
