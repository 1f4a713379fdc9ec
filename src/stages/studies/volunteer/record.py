"""What study `volunteer` leaves of a case, as its tables read it."""

from collections.abc import Mapping
from typing import Any

from stages.engine.record import Record


class VolunteerRecord(Record):
    """Variations of a volunteer's compression."""

    def runs(self, table: str) -> list[Mapping[str, Any]]:
        """Report of each variation of a table, such as `table_2`."""
        return [run for run in self.artefact.value("runs") if run["table"] == table]

    def mechanics(self, setting: str) -> Mapping[str, Any] | None:
        """Settings that the tables start from: `own`, `plain` or `smooth`; None where no variation could run."""
        found = self._given("mechanics")
        return None if found is None else dict(found[setting])
