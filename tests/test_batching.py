"""Rows of nested batches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._batching import put_rows, rows


@dataclass(frozen=True)
class Inner:
    values: np.ndarray
    pair: tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Outer:
    inner: Inner
    matrices: np.ndarray
    name: str
    missing: None = None


def batch(numbers):
    numbers = np.asarray(numbers, dtype=np.float64)
    return Outer(
        Inner(numbers, (2.0 * numbers, numbers.astype(int))), numbers[:, None, None] * np.ones((2, 2)), "batch"
    )


def same(first, second):
    np.testing.assert_array_equal(first.inner.values, second.inner.values)
    for one, other in zip(first.inner.pair, second.inner.pair, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(first.matrices, second.matrices)


def test_rows_are_those_of_every_array_within():
    chosen = rows(batch([1, 2, 3, 4]), np.array([3, 0]))
    same(chosen, batch([4, 1]))
    assert chosen.name == "batch"
    assert chosen.missing is None


def test_rows_are_written_into_every_array_within():
    whole = batch([1, 2, 3, 4])
    put_rows(whole, np.array([3, 1]), batch([7, 8]))
    same(whole, batch([1, 8, 3, 7]))
    put_rows(whole, np.array([0]), batch([5, 6]), np.array([1]))
    same(whole, batch([6, 8, 3, 7]))


def test_chosen_rows_are_no_longer_those_of_the_batch():
    whole = batch([1, 2, 3])
    put_rows(rows(whole, np.array([0, 1])), np.array([0]), batch([9]))
    same(whole, batch([1, 2, 3]))
