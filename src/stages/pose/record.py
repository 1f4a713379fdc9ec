"""What stage `pose` leaves: a view's image and geometry, and the maps of the methods without mechanics."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.localization.deformation import AffineDeformation
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.outlined import OUTLINE_RAYS
from mammoreg.pose.silhouette import pixels_at_detector, ray_angles
from stages.engine.artefact import Array, Fields, Value
from stages.engine.record import Record
from stages.views import SECOND_VOLUME

FINE_RAYS = 721
"""Rays on which results are measured and drawn."""

_OF_METHOD = ("angle_deg", "edge_p_mm", "middle_mm", "height_mm", "thickness_mm")
_OF_VIEW = ("source_detector_mm", "support_detector_mm", "pixel_mm", "rows", "columns")
_TISSUE_CODES = "0 air, 1 breast, 2 pectoral muscle"

Pixels = NDArray[np.float64]


@dataclass(frozen=True)
class ImageOutline:
    """An outline in a view's canonical image.

    Attributes:
        pixels: (N, 2), (column, row).
        weight: trust (N,), 1 where it is skin.
        meaning: in words.
    """

    pixels: Pixels
    weight: NDArray[np.float64]
    meaning: str = "outline between skin and air, canonical (column, row)"


@dataclass(frozen=True)
class ImageStorage:
    """How a mammogram's file holds the canonical image, of the same pixels: the axes that are flipped."""

    rows: int
    columns: int
    flip_rows: bool
    flip_columns: bool


@dataclass(frozen=True)
class PoseFields:
    """What is to be kept of a view.

    Attributes:
        view: the estimated geometry.
        rigid: geometry of method `rigid`.
        maps: methods without mechanics by name, from the breast to the plate frame of `view`.
        outline: None without an image and a second volume.
        mammogram, tissue: canonical image, bright is dense, and its labels; None without one.
        storage: of the mammogram.
        plates_known: whether a second volume shows where the plates end.
        drawn_mm: how far (3,) the breast was drawn over the plates, plate axes; None where the view does not tell.
        estimated: what neither header nor table gave.
        flags: doubts.
        values: what else was found.
    """

    view: ViewGeometry
    rigid: ViewGeometry
    maps: Mapping[str, AffineDeformation]
    outline: ImageOutline | None = None
    mammogram: NDArray[Any] | None = None
    tissue: NDArray[np.uint8] | None = None
    storage: ImageStorage | None = None
    plates_known: bool = False
    drawn_mm: Sequence[float] | None = None
    estimated: Sequence[str] = ()
    flags: Sequence[str] = ()
    values: Mapping[str, Value] = field(default_factory=dict)

    def fields(self) -> Fields:
        """The artefact's contents."""
        return Fields(arrays={**self._image(), **self._maps()}, values=self._values())

    def _image(self) -> dict[str, Array]:
        found = {}
        if self.mammogram is not None and self.tissue is not None:
            found["mammogram"] = Array(self.mammogram, "1", "canonical mammogram, bright is dense")
            found["breast_mask"] = Array(self.tissue, "1", f"canonical image: {_TISSUE_CODES}")
        if self.outline is not None:
            found["outline"] = Array(self.outline.pixels, "px", self.outline.meaning)
            found["outline_weight"] = Array(self.outline.weight, "1", "1 where the outline is skin, fading to 0")
        return found

    def _maps(self) -> dict[str, Array]:
        found = {}
        for name, affine in self.maps.items():
            meaning = f"method {name}, breast to plate frame"
            found[f"{name}_matrix"] = Array(affine.matrix, "1", meaning)
            found[f"{name}_offset"] = Array(affine.offset, "mm", meaning)
        return found

    def _values(self) -> dict[str, Value]:
        values: dict[str, Value] = {name: getattr(self.view, name) for name in (*_OF_METHOD, *_OF_VIEW)}
        values |= {f"rigid_{name}": getattr(self.rigid, name) for name in _OF_METHOD}
        if self.storage is not None:
            values |= {
                "stored_rows": self.storage.rows,
                "stored_columns": self.storage.columns,
                "flip_rows": self.storage.flip_rows,
                "flip_columns": self.storage.flip_columns,
            }
        return {
            **values,
            "plates_known": self.plates_known,
            "drawn_mm": None if self.drawn_mm is None else list(self.drawn_mm),
            "estimated": list(self.estimated),
            "flags": list(self.flags),
            **self.values,
        }


class PoseRecord(Record):
    """A view as later stages know it."""

    @cached_property
    def geometry(self) -> ViewGeometry:
        """Geometry of every method but `rigid`; the silhouette of a second volume is one of parallel beams."""
        return self._geometry("")

    def geometry_of(self, method: str) -> ViewGeometry:
        """Geometry of a method; `rigid` has its own angle and place, and parallel beams."""
        return replace(self._geometry("rigid_"), parallel=True) if method == "rigid" else self.geometry

    def _geometry(self, prefix: str) -> ViewGeometry:
        value = self.artefact.value
        placed = {name: float(value(f"{prefix}{name}")) for name in _OF_METHOD}
        source, support, pixel, rows, columns = (value(name) for name in _OF_VIEW)
        return ViewGeometry(
            **placed,
            source_detector_mm=float(source),
            support_detector_mm=float(support),
            pixel_mm=float(pixel),
            rows=int(rows),
            columns=int(columns),
            parallel=self.view == SECOND_VOLUME,
        )

    def affine(self, method: str) -> AffineDeformation:
        """Map of a method without mechanics, from the breast to the plate frame."""
        matrix, offset = (
            self.artefact.array(f"{method}_{name}", units) for name, units in (("matrix", "1"), ("offset", "mm"))
        )
        return AffineDeformation(np.asarray(matrix, dtype=float), np.asarray(offset, dtype=float))

    @cached_property
    def has_outline(self) -> bool:
        """Whether the view has an outline: not if it has neither image nor second volume."""
        return "outline" in self.artefact.names()

    def outline(self, rays: int = OUTLINE_RAYS) -> RadialOutline:
        """The outline in the view's image on rays, mm at the detector."""
        points = pixels_at_detector(self.artefact.array("outline", "px"), self.geometry)
        return radial_outline(points, self.artefact.array("outline_weight", "1"), ray_angles(rays))

    @cached_property
    def has_mammogram(self) -> bool:
        """Whether the view has an image: not where a second volume, or `compression`, stands for it."""
        return "mammogram" in self.artefact.names()

    @property
    def mammogram(self) -> NDArray[Any]:
        """The canonical image (rows, columns), bright is dense."""
        return self.artefact.array("mammogram", "1")

    @property
    def tissue(self) -> NDArray[np.uint8]:
        """Labels of the canonical image: 0 air, 1 breast, 2 pectoral muscle."""
        return self.artefact.array("breast_mask", "1")

    @property
    def plates_known(self) -> bool:
        """Whether a second volume shows where the plates end."""
        return bool(self.artefact.value("plates_known"))

    @property
    def drawn_mm(self) -> Points:
        """How far (3,) the view has seen the breast drawn over the plates, plate axes; a mammogram does not tell."""
        drawn = self.artefact.value("drawn_mm") if self.view == SECOND_VOLUME else None
        return np.zeros(3) if drawn is None else np.array(drawn, dtype=float)

    @property
    def relative_size(self) -> float | None:
        """How many times as large as the outline the compressed breast's silhouette is; None where nothing tells."""
        return self._number("relative_size")

    @property
    def imaged_share(self) -> float | None:
        """Volume that the image shows over that of the MR breast; None where the thickness was unknown."""
        return self._number("imaged_share")

    @property
    def force_n(self) -> float | None:
        """Plate force that header or table gives."""
        return self._number("header_force_n")

    @property
    def outline_step(self) -> float | None:
        """Grey step across the outline, a share of the breast's range of grey values; None without an image."""
        return self._number("outline_step")

    @property
    def flags(self) -> list[str]:
        """Doubts about the view."""
        return list(self.artefact.value("flags"))

    @property
    def estimated(self) -> list[str]:
        """What neither header nor table gave."""
        return list(self.artefact.value("estimated"))

    @property
    def row(self) -> dict[str, str]:
        """Values of the tables' rows with which the view was posed."""
        return dict(json.loads(self.artefact.attrs["row"]))

    @cached_property
    def storage(self) -> ImageStorage:
        """How the mammogram's file holds the image."""
        value = self.artefact.value
        rows, columns = int(value("stored_rows")), int(value("stored_columns"))
        return ImageStorage(rows, columns, bool(value("flip_rows")), bool(value("flip_columns")))

    def canonical_pixels(self, stored: Pixels) -> Pixels:
        """Pixels (..., 2) as (column, row) of the canonical image from those of the stored one."""
        size, flip, scale = self._turning()
        pixels = np.asarray(stored, dtype=float)
        flipped = np.where(flip, size - 1 - pixels, pixels)
        return np.asarray((flipped + 0.5) * scale - 0.5)

    def stored_pixels(self, canonical: Pixels) -> Pixels:
        """Pixels (..., 2) as (column, row) of the stored image from those of the canonical one."""
        size, flip, scale = self._turning()
        pixels = (np.asarray(canonical, dtype=float) + 0.5) / scale - 0.5
        return np.asarray(np.where(flip, size - 1 - pixels, pixels))

    def canonical_image(self, stored: NDArray[Any]) -> NDArray[Any]:
        """A stored mask turned into the canonical one; each canonical pixel takes the stored one under its centre."""
        size = self.geometry.rows, self.geometry.columns
        return _turned(stored, size, self.stored_pixels)

    def stored_image(self, canonical: NDArray[Any]) -> NDArray[Any]:
        """A canonical mask turned into the stored one; each stored pixel takes the canonical one under its centre."""
        return _turned(canonical, (self.storage.rows, self.storage.columns), self.canonical_pixels)

    def _turning(self) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
        """Stored size, flips and canonical pixels per stored one, each as (column, row)."""
        storage = self.storage
        size = np.array([storage.columns, storage.rows], dtype=float)
        flip = np.array([storage.flip_columns, storage.flip_rows])
        return size, flip, np.array([self.geometry.columns, self.geometry.rows], dtype=float) / size


def _turned(image: NDArray[Any], size: tuple[int, int], source: Any) -> NDArray[Any]:
    """An image of another size (rows, columns), whose pixels come from where `source` says, by nearest neighbour."""
    rows, columns = (np.arange(n) for n in size)
    from_columns = source(np.stack([columns, np.zeros_like(columns)], axis=1))[:, 0]
    from_rows = source(np.stack([np.zeros_like(rows), rows], axis=1))[:, 1]
    index = (np.rint(from_rows).astype(np.intp), np.rint(from_columns).astype(np.intp))
    return np.asarray(image[np.ix_(*(np.clip(i, 0, n - 1) for i, n in zip(index, image.shape, strict=True)))])
