"""How far a run is and how long it may still take, from what each rule typically costs."""

import time
from collections import Counter
from collections.abc import Callable, Mapping

# Seconds a job, as measured on the twins cohort on a busy core; only their ratios matter.
_TYPICAL_S = {
    "segment": 8.0,
    "mesh": 4.5,
    "pose": 14.0,
    "compress": 4.5,
    "shape": 4.0,
    "solve": 4.5,
    "project": 8.0,
    "localize": 9.0,
    "evaluate": 4.0,
    "figures": 17.0,
    "tables": 4.0,
    "report": 5.0,
    "complete": 1.0,
    "calibrate": 2.0,
    "all": 0.0,
    "runtime": 80.0,
    "table_1": 120.0,
    "volunteer": 50.0,
    "stability_batch": 300.0,
}
_UNKNOWN_S = 5.0
_DIGITAL_S = 20.0


def _typical_s(rule: str) -> float:
    return _TYPICAL_S.get(rule, _DIGITAL_S if rule.startswith("digital_") else _UNKNOWN_S)


class Progress:
    """Work done, in typical seconds, of all that a run has to do."""

    def __init__(self, jobs: Mapping[str, int], now: Callable[[], float] = time.monotonic) -> None:
        """Start the clock.

        Args:
            jobs: number of jobs by rule.
            now: a clock, s.
        """
        self._now = now
        self._start = now()
        self._left = Counter({rule: count for rule, count in jobs.items() if count > 0})
        self._total_s = self._left_s()

    def _left_s(self) -> float:
        return sum(count * _typical_s(rule) for rule, count in self._left.items())

    def finish(self, rule: str) -> None:
        """Count one job of a rule as done."""
        self._left[rule] = max(self._left[rule] - 1, 0)

    @property
    def share(self) -> float:
        """Share of the work that is done, 0 to 1."""
        return 1.0 - self._left_s() / self._total_s if self._total_s else 1.0

    @property
    def left_s(self) -> float | None:
        """Time left at the pace so far, s; None before the first job is done."""
        share = self.share
        return (self._now() - self._start) * (1.0 - share) / share if share > 0.0 else None

    @property
    def left(self) -> str:
        """Time left in words; empty before the first job is done."""
        return "" if self.left_s is None else f"about {duration(self.left_s)} left"


def duration(seconds: float) -> str:
    """A time as one reads it: seconds below one and a half minutes, then minutes, then hours."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
