"""Damaged files and journals, odd calls of the library and odd places of outputs: what came of them.

    python -m benchmarks.fuzz [--cases N] [--first NUMBER] [--format NAME] [--case NUMBER]

Each is read, or made, in a process that may crash or hang. Prints a row per format; calls have names such as `call of
estimate`. A case is made from the format's name and its number alone (and from the bytes that this
version of OpenCV writes): `--format NAME --case NUMBER` repeats one, and shows its traceback.
"""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import os
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

from benchmarks.support.fuzz.formats import Format
from benchmarks.support.fuzz.mutations import generator
from circlepose.io.images.formats import JPEG_2000_VARIABLE

Case = tuple[str, int]
"""name of the format and number"""

SOURCES = tuple(f"benchmarks.support.fuzz.{name}" for name in ("formats", "arguments", "outputs"))
"""modules with formats"""
HANG_S = 30.0
_START_S = 60.0
MEMORY_BYTES = 6 << 30
FAILURES = ("bug", "printed", "hang", "crash")


@dataclass(slots=True)
class Outcomes:
    """What came of the cases of a format."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: dict[int, str] = field(default_factory=dict)
    """by case: a bug, words on standard error, a hang or a crash"""


def fuzz(
    cases: Sequence[Case], source: str = "benchmarks.support.fuzz.formats", hang_s: float = HANG_S
) -> dict[str, Outcomes]:
    """Return what comes of `cases`, by format, read one after the other in a process that is replaced if it dies.

    The module `source` has the formats; over `hang_s` a case is given up.
    """
    found = {name: Outcomes() for name, _ in cases}
    done = 0
    while done < len(cases):
        for (name, number), (outcome, detail) in zip(
            cases[done:], _in_process(cases[done:], source, hang_s), strict=False
        ):
            found[name].counts[outcome] += 1
            if outcome in FAILURES:
                found[name].failures[number] = f"{outcome}: {detail}"
            done += 1
    return found


def damaged(sound: Format, name: str, number: int) -> bytes:
    """Return the file of one case of the format `name`."""
    return sound.damage(sound.content, generator(name, number))


def _in_process(cases: Sequence[Case], source: str, hang_s: float) -> Iterator[tuple[str, str]]:
    """Yield (outcome, detail) until all are done or one ends the process."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_read_all, args=(cases, source, theirs), daemon=True)
    process.start()
    theirs.close()
    try:
        for number in range(len(cases)):
            # The first waits for all imports.
            if not ours.poll(hang_s if number else hang_s + _START_S):
                yield "hang", f"over {hang_s:g} s"
                return
            try:
                yield ours.recv()
            except EOFError:
                process.join()
                yield "crash", f"exit code {process.exitcode}"
                return
    finally:
        process.kill()
        process.join()
        ours.close()


def _read_all(cases: Sequence[Case], source: str, results: Connection) -> None:
    """Read `cases` in this process, whose standard error nobody else writes to."""
    _limit_memory()
    # Its decoder has to hold, too, where it is asked for.
    os.environ[JPEG_2000_VARIABLE] = "1"
    known = importlib.import_module(source).formats()
    warnings.simplefilter("always")
    with tempfile.TemporaryFile() as printed:
        os.dup2(printed.fileno(), 2)
        sys.stderr = os.fdopen(os.dup(2), "w", buffering=1)
        for name, number in cases:
            outcome, detail = "bug", ""
            try:
                outcome = known[name].read(damaged(known[name], name, number), number)
            except Exception as error:
                detail = f"{type(error).__name__}: {error}"
            words = _taken(printed)
            if words and outcome != "bug":
                outcome, detail = "printed", words
            results.send((outcome, detail[:300]))


def _taken(printed: tempfile._TemporaryFileWrapper[bytes]) -> str:
    """Return what was printed since the last call."""
    sys.stderr.flush()
    size = os.fstat(printed.fileno()).st_size
    if not size:
        return ""
    text = os.pread(printed.fileno(), 2000, 0).decode("utf-8", "replace")
    os.ftruncate(printed.fileno(), 0)
    os.lseek(printed.fileno(), 0, os.SEEK_SET)
    return text


def _limit_memory() -> None:
    """Make a decoder that asks for too much fail here, instead of the whole machine."""
    try:
        import resource  # noqa: PLC0415 - not on Windows
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))


def main() -> None:
    """Print a row per format, and all failures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000, help="of each format")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--format", help="only this one")
    parser.add_argument("--case", type=int, help="only this one, with its traceback")
    options = parser.parse_args()
    sources = {name: source for source in SOURCES for name in importlib.import_module(source).formats()}
    if options.case is not None:
        chosen = importlib.import_module(sources[options.format]).formats()[options.format]
        content = damaged(chosen, options.format, options.case)
        print(f"{len(content)} bytes: {content[:400]!r}", flush=True)
        print(chosen.read(content, options.case))
        return
    print("| format | cases | read | refused, by status | bugs | printed | hangs | crashes |")
    print("|---|---|---|---|---|---|---|---|")
    names = [options.format] if options.format else list(sources)
    total = Outcomes()
    for name in names:
        cases = [(name, number) for number in range(options.first, options.first + options.cases)]
        outcomes = fuzz(cases, sources[name])[name]
        total.counts += outcomes.counts
        print(_row(name, outcomes.counts), flush=True)
        for case, failure in list(outcomes.failures.items())[:20]:
            print(f"--format {name!r} --case {case}: {failure!r}", file=sys.stderr, flush=True)
    if len(names) > 1:
        print(_row("all", total.counts))


def _row(name: str, counts: Counter[str]) -> str:
    refused = {outcome: number for outcome, number in counts.items() if outcome not in ("read", *FAILURES)}
    kinds = ", ".join(f"{status} {number}" for status, number in sorted(refused.items()))
    failures = " | ".join(str(counts[outcome]) for outcome in FAILURES)
    return f"| {name} | {counts.total()} | {counts['read']} | {sum(refused.values())}: {kinds} | {failures} |"


if __name__ == "__main__":
    main()
