"""Runs on a cluster of this machine, whose workers, scheduler and images misbehave."""

from __future__ import annotations

import csv
import io
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from benchmarks.support.services import Cluster, free_port, kill, s3_server
from circlepose.batch.measure import MeasureOptions, WorkItem
from circlepose.results import Status
from circlepose.targets.target import Target
from circlepose_cli.app import main
from tests.support.discs import CAMERA, RADIUS_MM, disc_folder, found_notes, write_disc
from tests.support.paths import SUPPORT
from tests.support.processes import GO_ON, SETTLE

if sys.platform == "win32":
    pytest.skip("signals end the processes here", allow_module_level=True)
pytest.importorskip("distributed")
pytest.importorskip("fsspec")

COMMAND = [sys.executable, "-c", "import sys; from circlepose_cli.app import main; sys.exit(main())", "estimate"]
TRAPS = {"PYTHONPATH": str(SUPPORT / "traps")}


def run(*args: object, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *map(str, args)], capture_output=True, text=True, timeout=120, check=False, **options
    )


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 images, of which two are none."""
    folder = disc_folder(tmp_path_factory.mktemp("cluster") / "imgs", images=38)
    (folder / "disc5b.png").write_bytes(b"no image")
    (folder / "disc17b.png").write_bytes((folder / "disc17.png").read_bytes()[:-100])
    return folder


@pytest.fixture(scope="module")
def local_table(folder: Path) -> bytes:
    done = run(folder, "--jobs", 2, "-o", folder.parent / "local.csv")
    assert done.returncode == 3
    return (folder.parent / "local.csv").read_bytes()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with Cluster(tmp_path_factory.mktemp("dask"), 2) as cluster:
        yield cluster


def test_the_table_is_that_of_a_local_run(cluster: Cluster, folder: Path, local_table: bytes, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    # By a path that holds in this folder only.
    done = run(folder.name, "--cluster", cluster.address, "-o", out, cwd=folder.parent)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (
        3,
        f"38 measured, 2 failed (not_an_image 1, truncated_image 1), 38 ambiguous: {SETTLE}",
    )
    assert out.read_bytes() == local_table
    assert [path.name for path in tmp_path.iterdir()] == ["out.csv"]


def test_a_run_that_was_killed_is_resumed(cluster: Cluster, folder: Path, local_table: bytes, tmp_path: Path) -> None:
    out, journal = tmp_path / "out.csv", tmp_path / "out.csv.journal"
    command = [*COMMAND, str(folder), "--cluster", cluster.address, "-o", str(out)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        wait_for_lines(journal, 4, process)
        process.kill()
    assert not out.exists()
    done = run(folder, "--cluster", cluster.address, "-o", out, "--resume")
    assert done.returncode == 3
    assert out.read_bytes() == local_table


def wait_for_lines(journal: Path, number: int, process: subprocess.Popen[bytes]) -> None:
    while not (journal.exists() and journal.read_bytes().count(b"\n") > number):
        assert process.poll() is None
        time.sleep(0.005)


def test_a_row_leaves_though_the_producer_is_silent_and_ctrl_c_ends_the_wait(cluster: Cluster, folder: Path) -> None:
    with subprocess.Popen(
        [*COMMAND, "-", "--cluster", cluster.address, "--format", "jsonl"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        bufsize=1,
    ) as process:
        assert process.stdin
        assert process.stdout
        for number in range(2):
            print(folder / f"disc{number}.png", file=process.stdin)
            assert f"disc{number}.png" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert err.endswith(f"2 measured, 0 failed, interrupted: the rest not done, 2 ambiguous: {SETTLE}\n{GO_ON}")


def test_images_are_taken_only_a_little_ahead(cluster: Cluster, folder: Path) -> None:
    from circlepose.batch.cluster import run as module  # noqa: PLC0415 - needs dask

    taken = 0

    def items() -> Iterator[WorkItem]:
        nonlocal taken
        for taken in range(1, 10**6):
            yield WorkItem(folder / "disc0.png", f"{taken}", CAMERA, Target.circle(RADIUS_MM))

    most = module.CHUNK_MOST * module._CHUNKS_LEAST
    with closing(module.measure_on_cluster(items(), MeasureOptions(), cluster.address)) as results:
        for number in range(1, 41):
            assert next(results).image == f"{number}"
            assert taken <= number + most


def test_a_worker_that_is_killed_costs_no_image(folder: Path, local_table: bytes, tmp_path: Path) -> None:
    out, journal = tmp_path / "out.csv", tmp_path / "out.csv.journal"
    with Cluster(tmp_path, 2) as cluster:
        command = [*COMMAND, str(folder), "--cluster", cluster.address, "-o", str(out)]
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
            wait_for_lines(journal, 6, process)
            kill(cluster.workers[0])
            assert process.wait(60) == 3
    assert out.read_bytes() == local_table


def test_a_scheduler_that_is_restarted_costs_no_image(folder: Path, local_table: bytes, tmp_path: Path) -> None:
    out, journal = tmp_path / "out.csv", tmp_path / "out.csv.journal"
    with Cluster(tmp_path, 2) as cluster:
        command = [*COMMAND, str(folder), "--cluster", cluster.address, "-o", str(out)]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            wait_for_lines(journal, 4, process)
            cluster.kill_scheduler()
            time.sleep(1.0)
            assert process.poll() is None
            cluster.start_scheduler()
            cluster.start_worker()
            _, err = process.communicate(timeout=100)
        assert process.returncode == 3
    assert out.read_bytes() == local_table
    assert f"{cluster.address}: the scheduler does not answer; waiting for it\n" in err
    assert f"{cluster.address}: the scheduler is back\n" in err
    assert "Traceback" not in err, err


def test_whatever_becomes_of_an_image_it_has_a_row(folder: Path, tmp_path: Path) -> None:
    images = tmp_path / "imgs"
    images.mkdir()
    for name in ("a", "bug", "crash", "endless", "fatal", *(f"z{number}" for number in range(15))):
        write_disc(images / f"{name}.png")
    with Cluster(tmp_path, 0, nanny=True) as cluster:
        for _ in range(2):
            cluster.start_worker(**TRAPS)
        camera = ("--calib", folder / "camera.yaml", "--radius-mm", RADIUS_MM)
        done = run(images, *camera, "--cluster", cluster.address, "--timeout", 20, "--format", "csv")
    statuses = {row["image"]: row["status"] for row in rows_of(done.stdout)}
    assert list(statuses) == sorted(statuses, key=lambda name: (name[0], len(name), name))
    assert statuses.pop("crash.png") == statuses.pop("fatal.png") == Status.WORKER_DIED
    assert statuses.pop("endless.png") == Status.TIMED_OUT
    assert statuses.pop("bug.png") == Status.INTERNAL_ERROR
    assert Counter(statuses.values()) == {Status.OK: 16}
    assert done.returncode == 1
    assert "crash.png: its worker process died twice (killed by SIGKILL)\n" in done.stderr
    assert "fatal.png: its worker process died twice (a worker of the cluster was lost with it)\n" in done.stderr
    assert "endless.png: was not measured within 20 s\n" in done.stderr
    assert "bug.png: oh\n" in done.stderr


@pytest.mark.parametrize(
    ("trap", "how"),
    [
        ({"TRAP_OPENCV": "4.9.0"}, "opencv 4.9.0 (here "),
        ({"TRAP_CIRCLEPOSE": "0.0.1"}, "circlepose 0.0.1 (here "),
        ({"TRAP_CIRCLEPOSE": ""}, "circlepose not at all (here "),
    ],
)
def test_a_worker_with_other_versions_is_refused(
    folder: Path, tmp_path: Path, trap: dict[str, str], how: str
) -> None:
    out = tmp_path / "out.csv"
    with Cluster(tmp_path, 0) as cluster:
        cluster.start_worker(**TRAPS, **trap)
        done = run(folder, "--cluster", cluster.address, "-o", out)
        assert (done.returncode, out.exists()) == (2, False)
        last = done.stderr.splitlines()[-1]
        assert last.startswith("circlepose: --cluster: the worker tcp://")
        assert f" has {how}" in last
        assert last.endswith("; install there what is installed here.")


def test_a_scheduler_without_circlepose_is_refused(folder: Path, tmp_path: Path) -> None:
    with Cluster(tmp_path, 0) as cluster:
        cluster.kill_scheduler()
        cluster.start_scheduler(**TRAPS, TRAP_CIRCLEPOSE="")
        cluster.start_worker()
        done = run(folder, "--cluster", cluster.address)
    assert (done.returncode, done.stdout) == (2, "")
    last = done.stderr.splitlines()[-1]
    assert last.startswith("circlepose: --cluster: the scheduler has circlepose not at all (here ")


def test_beside_a_right_worker_a_wrong_one_is_left_out(folder: Path, local_table: bytes, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    with Cluster(tmp_path, 1) as cluster:
        cluster.start_worker(**TRAPS, TRAP_OPENCV="4.9.0")
        time.sleep(4.0)
        done = run(folder, "--cluster", cluster.address, "-o", out)
        assert done.returncode == 3
        assert ": is not used: this worker has opencv 4.9.0 (here " in done.stderr
    assert out.read_bytes() == local_table


def test_a_worker_that_comes_late_is_waited_for(folder: Path, local_table: bytes, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    with Cluster(tmp_path, 0) as cluster:
        command = [*COMMAND, str(folder), "--cluster", cluster.address, "-o", str(out)]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr
            said = "".join(process.stderr.readline() for _ in range(3))
            assert said == found_notes(folder) + f"{cluster.address}: there is no worker; waiting for one\n"
            cluster.start_worker()
            # Messages of images may be quicker than that of the worker.
            told = process.stderr.read()
            assert f"{cluster.address}: a worker has come\n" in told
            assert process.wait(60) == 3
    assert out.read_bytes() == local_table


def test_a_bucket_measured_by_a_cluster_into_the_bucket(folder: Path, local_table: bytes, tmp_path: Path) -> None:
    pytest.importorskip("moto")
    pytest.importorskip("flask")
    fsspec = pytest.importorskip("fsspec")
    pytest.importorskip("s3fs")
    with s3_server() as settings, Cluster(tmp_path, 0) as cluster:
        endpoint = {"key": "key", "secret": "very-secret", "endpoint_url": settings["AWS_ENDPOINT_URL"]}
        files = fsspec.filesystem("s3", **endpoint, skip_instance_cache=True)
        files.mkdir("bucket")
        for path in folder.glob("*.png"):
            files.pipe_file(f"bucket/imgs/{path.name}", path.read_bytes())
        cluster.start_worker(**settings)
        given = ("--calib", folder / "camera.yaml", "--target", folder / "target.yaml", "--cluster", cluster.address)
        environment = {**os.environ, **settings, "XDG_STATE_HOME": str(tmp_path / "state")}
        command = ("s3://bucket/imgs/", *given, "-o", "s3://bucket/out/poses.csv")
        done = run(*command, env=environment)
        assert (done.returncode, "very-secret" in done.stderr) == (3, False)
        by_image = {row["image"]: row for row in rows_of(files.cat_file("bucket/out/poses.csv").decode())}
        assert by_image == {row["image"]: row for row in rows_of(local_table.decode())}
        assert [path.rsplit("/")[-1] for path in files.ls("bucket/out/", refresh=True)] == ["poses.csv"]
        assert not list((tmp_path / "state" / "circlepose").iterdir())
        refused = run("s3://bucket/imgs/", *given, "-o", "s3://none/poses.csv", env=environment)
        assert refused.returncode == 2
        assert refused.stderr.startswith("circlepose: s3://none/poses.csv: cannot be written (")
        assert refused.stderr.count("\n") == 1


def test_a_cluster_that_is_not_there_is_one_sentence(folder: Path) -> None:
    address = f"tcp://127.0.0.1:{free_port()}"
    done = run(folder, "--cluster", address)
    assert (done.returncode, done.stdout) == (2, "")
    message = done.stderr.removeprefix(found_notes(folder))
    assert message.startswith(f"circlepose: --cluster {address}: no scheduler of dask answers there (")
    assert message.count("\n") == 1


@pytest.mark.parametrize("typed", ["nonsense://x:1", "localhost:8786", "tcp://h", "tcp://h:http", ""])
def test_what_is_no_address_is_one_sentence(folder: Path, capfd: pytest.CaptureFixture[str], typed: str) -> None:
    assert main(["estimate", str(folder), "--cluster", typed]) == 2
    expected = f"circlepose: --cluster {typed}: expected the address of a scheduler, as tcp://host:8786.\n"
    assert capfd.readouterr() == ("", found_notes(folder) + expected)


def test_jobs_are_not_for_clusters(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", str(folder), "--jobs", "2", "--cluster", "tcp://h:1"]) == 2
    assert "--jobs, --cluster: give one of them" in capfd.readouterr().err


def test_without_dask_one_sentence_says_what_to_install(
    folder: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["estimate", str(folder), "--cluster", "tcp://h:1"]) == 2
    err = capfd.readouterr().err
    assert "--cluster: needs dask (" in err
    assert "pip install 'circlepose[cluster]'" in err


def test_dask_is_imported_only_where_it_is_asked_for(folder: Path) -> None:
    code = (
        "import sys; from circlepose_cli.app import main; code = main(['estimate', *sys.argv[1:]]); "
        "print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(folder / "disc0.png")],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert {"dask", "distributed", "fsspec"}.isdisjoint(done.stderr.split())
