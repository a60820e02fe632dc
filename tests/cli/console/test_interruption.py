import signal
import sys
import weakref

import pytest

from circlepose_cli.console.interruption import Interruption


class Thing:
    pass


def _collect(callback):
    thing = Thing()
    reference = weakref.ref(thing, callback)
    del thing
    assert reference() is None


def test_an_interrupt_that_is_lost_in_a_callback_is_noted_and_not_shown(monkeypatch):
    shown = []
    monkeypatch.setattr(sys, "unraisablehook", shown.append)
    with Interruption() as interruption, interruption.waiting():
        _collect(lambda _: signal.raise_signal(signal.SIGINT))
        assert interruption.received
    assert shown == []


def test_what_else_is_lost_in_a_callback_is_shown(monkeypatch):
    shown = []
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: shown.append(lost.exc_type))
    with Interruption() as interruption, interruption.waiting():
        _collect(lambda _: 1 / 0)
    _collect(lambda _: [].pop())
    assert shown == [ZeroDivisionError, IndexError]


def test_an_interrupt_ends_a_wait():
    with Interruption() as interruption, pytest.raises(KeyboardInterrupt), interruption.waiting():
        signal.raise_signal(signal.SIGTERM)
    assert interruption.received
