"""What becomes of work that was handed out to a cluster, each by the number under which it was."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class _OfWork:
    number: int


class Began(_OfWork):
    """A worker began to work."""


class Ended(_OfWork):
    """A worker has done its work; its answer may still be lost with it."""


@dataclass(frozen=True, slots=True)
class Done(_OfWork):
    """A worker has answered."""

    answer: bytes


class WorkersDied(_OfWork):
    """The scheduler does not try again: too many workers died."""


class Dropped(_OfWork):
    """What was handed out is no longer known there: the scheduler was restarted, or has forgotten it."""


@dataclass(frozen=True, slots=True)
class Broken(_OfWork):
    """A worker could not even begin."""

    reason: str


Event = Began | Ended | Done | WorkersDied | Dropped | Broken
