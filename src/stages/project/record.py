"""What stage `project` leaves: the breast as each method deforms it, and its projection."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from stages.engine.artefact import Array, Fields, Value, VolumeField
from stages.engine.record import Record


@dataclass
class ProjectFields:
    """Contents of the artefact as methods are added one by one.

    Attributes:
        step: pixels of the view's image in one of the projection, along each axis.
        angle_deg: of the plate frame in which the volumes lie.
    """

    step: int
    angle_deg: float
    arrays: dict[str, Array] = field(default_factory=dict)
    volumes: dict[str, VolumeField] = field(default_factory=dict)
    values: dict[str, Value] = field(default_factory=dict)

    def add(
        self,
        method: str,
        image: NDArray[Any],
        mask: NDArray[Any],
        correlation: float | None = None,
        deformed_mr: Volume | None = None,
    ) -> None:
        """One method's projection and its silhouette, the image's correlation with it, and the MR volume it deforms."""
        self.arrays[f"{method}/projection"] = Array(image, "1", f"attenuation at 20 keV, method {method}, by blocks")
        self.arrays[f"{method}/mask"] = Array(mask, "1", f"silhouette of the breast, method {method}, by blocks")
        if correlation is not None:
            self.values[f"{method}_ncc"] = correlation
        if deformed_mr is not None:
            self.volumes[f"{method}/mr"] = VolumeField(deformed_mr, "1", f"MR volume, method {method}")

    def fields(self) -> Fields:
        """The artefact's contents."""
        return Fields(
            arrays=self.arrays,
            volumes=self.volumes,
            values={"step": self.step, "angle_deg": self.angle_deg, **self.values},
        )


class ProjectRecord(Record):
    """Projections of a view; of an artefact whose status is not ok what there is."""

    @property
    def step(self) -> int:
        """Pixels of the view's image in one of the projection, along each axis."""
        return int(self.artefact.value("step"))

    def shows(self, method: str) -> bool:
        """Whether a method was projected."""
        return f"{method}/projection" in self.artefact.names()

    def projection(self, method: str) -> NDArray[np.float64]:
        """Attenuation by blocks of pixels."""
        return self.artefact.array(f"{method}/projection", "1")

    def silhouette(self, method: str) -> NDArray[np.bool_]:
        """Where the breast is, by blocks of pixels."""
        return np.asarray(self.artefact.array(f"{method}/mask", "1") != 0)

    def deformed_mr(self, method: str) -> Volume | None:
        """The MR volume as a method deforms it, plate frame; None where it was not kept."""
        name = f"{method}/mr"
        return self.artefact.volume(name, frame="plate") if name in self.artefact.volume_names() else None

    def correlation(self, method: str) -> float | None:
        """Normalised cross-correlation of projection and mammogram."""
        return self._number(f"{method}_ncc")
