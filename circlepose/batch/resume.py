"""Which images need not be measured again: those whose file, camera and target are what they were."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import lru_cache
from hashlib import blake2b
from pathlib import Path
from typing import TypeAlias

from circlepose.batch.journal import Journal
from circlepose.batch.measure import MeasureOptions, WorkItem
from circlepose.batch.remote_states import with_states
from circlepose.batch.versions import versions
from circlepose.camera.camera import Camera
from circlepose.errors import UsageError
from circlepose.io.remote.images import RemoteFile
from circlepose.io.tables.lossless import plain_result, restored_result
from circlepose.results import ImageResult, Status
from circlepose.targets.target import Target

Measure: TypeAlias = Callable[[Iterable[WorkItem | ImageResult]], Generator[ImageResult, None, None]]

LOST = frozenset({Status.TIMED_OUT, Status.WORKER_DIED})
"""outcomes that another try may change"""
_NOT_KEPT = LOST | {Status.UNREADABLE, Status.INTERNAL_ERROR}


@dataclass(frozen=True, slots=True)
class _Entry:
    """What the result of an image depends on, besides the conditions of the run."""

    image: str
    path: str
    size: int
    mtime_ns: int
    overlay: str | None
    camera: str
    """digest"""
    target: str
    """digest"""
    world_board: str
    """digest"""

    @property
    def key(self) -> str:
        return f"{self.image}\0{self.path}"


def conditions(options: MeasureOptions) -> Mapping[str, str]:
    """Return, by name, what all results of a run depend on."""
    return {**versions(), **{name: str(value) for name, value in asdict(options).items()}}


def measure_with_journal(
    items: Iterable[WorkItem], journal: Journal, measure: Measure, warn: Callable[[str], None]
) -> Generator[ImageResult, None, None]:
    """Yield the results of all `items` in their order: those in `journal` from there, the others from `measure`.

    What is measured is added to the journal before it is yielded, except what another try may change. An image whose
    entry cannot be read is measured again; `warn` gets a sentence that says so. Raises `UsageError` at an image that
    was finished with another camera or target: a table must not mix them.
    """
    begun: deque[_Entry | None] = deque()

    def still_to_measure() -> Iterator[WorkItem | ImageResult]:
        for item in with_states(items):
            # Before the image is read: a file that changes meanwhile is measured again next time.
            entry = _entry(item)
            known = None if entry is None else _finished(entry, item, journal, warn)
            journal.reused += known is not None
            begun.append(entry if known is None else None)
            yield item if known is None else known

    with closing(measure(still_to_measure())) as results:
        for result in results:
            entry = begun.popleft()
            if entry is not None and result.status not in _NOT_KEPT:
                journal.add(entry.key, {**asdict(entry), "result": plain_result(result)})
            yield result


def _entry(item: WorkItem) -> _Entry | None:
    if isinstance(item.path, RemoteFile) and item.path.listed is None:
        # It was asked for in vain.
        return None
    try:
        stat = item.path.stat()
    except (OSError, ValueError):
        return None
    return _Entry(
        image=item.name,
        path=str(item.path),
        size=stat.st_size,
        mtime_ns=stat.st_mtime_ns,
        overlay=None if item.overlay is None else str(item.overlay),
        camera=_camera_digest(item.camera),
        target=_target_digest(item.target),
        world_board=_target_digest(item.world_board),
    )


def _finished(entry: _Entry, item: WorkItem, journal: Journal, warn: Callable[[str], None]) -> ImageResult | None:
    """Return the result of an image that is finished and has not changed."""
    try:
        values = journal.find(entry.key)
        if values is None:
            return None
        before = _Entry(**{name: values[name] for name in _Entry.__slots__})  # type: ignore[arg-type]
        result = restored_result(values["result"])
    except (KeyError, ValueError) as error:
        warn(f"{journal.path}: the entry of {item.name} cannot be read ({error}); the image is measured again.")
        return None
    if before.key != entry.key or result.image != item.name:
        return None
    for what in ("camera", "target", "world_board"):
        if getattr(before, what) != getattr(entry, what):
            name = what.replace("_", " ")
            raise UsageError(
                f"{journal.path}: {item.name} was measured with another {name}. Give the {name} of that run, "
                "or leave out --resume to measure all images again."
            )
    if not {circle.radius_mm for circle in result.circles} <= set(item.target.radii_mm):
        warn(f"{journal.path}: the entry of {item.name} has radii that are not the target's; it is measured again.")
        return None
    if before != entry or (item.overlay is not None and not item.overlay.exists()):
        return None
    return result


@lru_cache(maxsize=64)
def _camera_digest(camera: Camera) -> str:
    matrix, coefficients = camera.camera_matrix.tolist(), camera.dist_coeffs.tolist()
    numbers = (matrix, coefficients, camera.image_size, camera.model, camera.sigma)
    return _digest(repr(numbers))


@lru_cache(maxsize=64)
def _target_digest(target: Target | None) -> str:
    return _digest(repr(target))


def _digest(text: str) -> str:
    return blake2b(text.encode(), digest_size=8).hexdigest()


def journal_path(place: Path) -> Path:
    """Return where the journal of the output `place` is."""
    return place.with_name(f"{place.name}.journal")
