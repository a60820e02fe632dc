"""What becomes of work that was handed out to a cluster, each by the number under which it was."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Began:
    """A worker began to work."""

    number: int


@dataclass(frozen=True, slots=True)
class Ended:
    """A worker has done its work; its answer may still be lost with it."""

    number: int


@dataclass(frozen=True, slots=True)
class Done:
    """A worker has answered."""

    number: int
    answer: bytes


@dataclass(frozen=True, slots=True)
class WorkersDied:
    """The scheduler does not try again: too many workers died."""

    number: int


@dataclass(frozen=True, slots=True)
class Dropped:
    """What was handed out is no longer known there: the scheduler was restarted, or was told to forget it."""

    number: int


@dataclass(frozen=True, slots=True)
class Broken:
    """A worker could not even begin."""

    number: int
    reason: str


Event = Began | Ended | Done | WorkersDied | Dropped | Broken
