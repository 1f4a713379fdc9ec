"""What a stage left, behind typed names: each stage's `record.py` alone knows the keys of its artefact."""

from typing import Any

from mammoreg.geometry.frames import Laterality
from stages.engine.artefact import Artefact


class Record:
    """An artefact that ended well, opened by the stage's own names; contents are read when asked for."""

    def __init__(self, artefact: Artefact) -> None:
        self.artefact = artefact

    @property
    def view(self) -> str:
        """CC, MLO or 3D; empty where the stage runs once per case."""
        return self.artefact.view or ""

    @property
    def laterality(self) -> Laterality:
        """Side of the breast."""
        return self.artefact.laterality

    def _given(self, name: str, otherwise: Any = None) -> Any:
        """A value, or something else where the artefact has none of that name."""
        return self.artefact.value(name) if name in self.artefact.value_names() else otherwise

    def _number(self, name: str) -> float | None:
        """A number; None where the artefact has none of that name, or an empty one."""
        number = self._given(name)
        return None if number is None else float(number)
