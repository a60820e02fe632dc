"""Start-up, which counts in pipelines: the best of five runs of each command, in s.

python -m benchmarks.startup
"""

from __future__ import annotations

import subprocess
import sys
import time

COMMANDS = {
    "circlepose --help": [sys.executable, "-m", "circlepose", "--help"],
    "circlepose estimate --help": [sys.executable, "-m", "circlepose", "estimate", "--help"],
    'python -c "import cv2"': [sys.executable, "-c", "import cv2"],
    'python -c "import circlepose"': [sys.executable, "-c", "import circlepose"],
}


def best_of(command: list[str], runs: int = 5) -> float:
    """Return the shortest time (s) of `runs` runs."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        subprocess.run(command, capture_output=True, check=True)
        times.append(time.perf_counter() - start)
    return min(times)


if __name__ == "__main__":
    print("| command | s |\n|---|---|")
    for name, command in COMMANDS.items():
        print(f"| `{name}` | {best_of(command):.2f} |")
