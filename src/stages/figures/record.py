"""What stage `figures` leaves: pictures and exported files beside its artefact, and how they are listed in it."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from stages.engine.artefact import Fields
from stages.engine.failures import Failure
from stages.engine.record import Record

PICTURES, EXPORTS = "figures", "export"
"""Folders beside the artefact."""


@dataclass(frozen=True)
class Picture:
    """A picture of a case with what stands beside it in the report."""

    name: str
    title: str
    caption: str


def figures_fields(
    pictures: Sequence[tuple[Picture, bytes]], exports: Mapping[str, bytes], failure: Failure | None
) -> Fields:
    """The artefact's contents from pictures with their PNG, exported files by name, and what failed before."""
    files = {f"{PICTURES}/{picture.name}.png": png for picture, png in pictures}
    files |= {f"{EXPORTS}/{name}": content for name, content in exports.items()}
    listed = [asdict(picture) for picture, _ in pictures]
    return Fields(values={"pictures": listed, "files": sorted(files)}, files=files, failure=failure)


class FiguresRecord(Record):
    """Pictures and exports of a case; of an artefact that failed what there is, perhaps nothing."""

    @property
    def pictures(self) -> list[Picture]:
        """The pictures in their order."""
        return [Picture(**listed) for listed in self._given("pictures", [])]

    def png(self, picture: Picture) -> bytes | None:
        """A picture's file, None if it is gone."""
        path = self.artefact.path.parent / PICTURES / f"{picture.name}.png"
        return path.read_bytes() if path.is_file() else None

    @property
    def exported(self) -> bool:
        """Whether there are files for other programs."""
        return any(name.startswith(f"{EXPORTS}/") for name in self._given("files", []))
