"""On the path of a cluster's workers, makes some of their images dangerous, or the workers others than they are."""

import importlib.metadata
import os
import signal
import time

from circlepose.batch import measure, versions

if "TRAP_OPENCV" in os.environ:
    ours = versions.versions()
    versions.versions = lambda: {**ours, "opencv": os.environ["TRAP_OPENCV"]}

if "TRAP_CIRCLEPOSE" in os.environ:
    version_of = importlib.metadata.version
    importlib.metadata.version = lambda name: (
        os.environ["TRAP_CIRCLEPOSE"] or None if name == "circlepose" else version_of(name)
    )

measure_file = measure.measure_file


def measure_or_fall(item, options):
    name = item.path.name
    if name.startswith("crash"):
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("fatal"):
        # The worker above it.
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60.0)
    if name.startswith("endless"):
        time.sleep(60.0)
    if name.startswith("bug"):
        raise ZeroDivisionError("oh")
    return measure_file(item, options)


measure.measure_file = measure_or_fall
