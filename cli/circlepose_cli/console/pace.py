"""How fast a run goes, and how long it still takes."""

from __future__ import annotations

from collections import deque

_SPAN_S = 30.0
_STEP_S = 1.0


class Pace:
    """Counts what is done; rates are of the last half minute, so that a slow start or a resumed part is forgotten."""

    def __init__(self, now_s: float) -> None:
        self.done = 0
        self._marks: deque[tuple[float, int]] = deque([(now_s, 0)])

    def count(self, now_s: float) -> None:
        """Note that one more is done."""
        self.done += 1
        if now_s - self._marks[-1][0] >= _STEP_S:
            self._marks.append((now_s, self.done))
        while len(self._marks) > 1 and now_s - self._marks[1][0] >= _SPAN_S:
            self._marks.popleft()

    def per_second(self, now_s: float) -> float:
        """Return the rate, 0 where nothing is known."""
        since, done = self._marks[0]
        return (self.done - done) / (now_s - since) if now_s > since else 0.0

    def left_s(self, now_s: float, total: int | None) -> float | None:
        """Return the time that the rest takes, in s, or None where it is not known."""
        rate = self.per_second(now_s)
        return None if total is None or rate == 0.0 else (total - self.done) / rate


def duration(seconds: float) -> str:
    """Return a duration in the two largest units that it has: 45 s, 3 min 20 s, 5 h 12 min, 2 d 3 h."""
    whole = round(seconds)
    units = (("d", whole // 86400), ("h", whole // 3600 % 24), ("min", whole // 60 % 60), ("s", whole % 60))
    first = next((number for number, (_, value) in enumerate(units) if value), len(units) - 1)
    return " ".join(f"{value} {unit}" for unit, value in units[first : first + 2] if value or unit == "s")
