"""Mammograms of a digital patient: cone-beam projection, scatter, blur, noise and presentation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.geometry import ViewGeometry, plate_to_breast
from mammoreg.phantom.anatomy import AIR, LUNG, MUSCLE, RIB, SKIN, SOFT, Tissue
from mammoreg.phantom.shape import Array

SPACING_MM = 0.6
FAT_PER_MM, GLAND_PER_MM, SKIN_PER_MM, MUSCLE_PER_MM, LESION_PER_MM = 0.0513, 0.0767, 0.0841, 0.0865, 0.090
"""Linear attenuation at 20 keV (reference data, `attenuation_20kev.csv`); the lesion a little above muscle."""
LESION_PATH_MM = 1.0
"""A beam that passes at least this much lesion belongs to the lesion's mask."""

CONTRAST = 3.0
"""Exponent of the presentation: spreads the grey values of dense tissue."""

Image = NDArray[np.float32]


@dataclass(frozen=True)
class Exposure:
    """How an image is taken.

    Attributes:
        photons: per pixel in air.
        scatter: share of scattered over primary radiation.
        scatter_mm, blur_mm: standard deviations of scatter and of the detector's blur.
        equalisation: share of the peripheral thinning that presentation makes up for.
    """

    photons: float
    scatter: float
    scatter_mm: float
    blur_mm: float
    equalisation: float


@dataclass(frozen=True)
class Pectoral:
    """A wedge of muscle in the upper posterior corner of an oblique view, plate frame, mm.

    Attributes:
        top_m: medial plate coordinate of the image's upper end of the breast.
        width, height: legs of the wedge: along posterior at its top, along medial at the chest wall.
        thickness: share of the plates' gap that it fills.
    """

    top_m: float
    width: float
    height: float
    thickness: float

    def holds(self, points: Array, view: ViewGeometry) -> NDArray[np.bool_]:
        """Whether points (N, 3) of the plate frame lie in the wedge."""
        front = view.edge_p_mm - points[:, 1]
        allowed = self.width * (1.0 - (points[:, 0] - self.top_m) / self.height)
        middle = np.abs(points[:, 2] - view.height_mm - 0.5 * view.thickness_mm)
        return np.asarray((front < allowed) & (middle < 0.5 * self.thickness * view.thickness_mm))


@dataclass(frozen=True)
class Projection:
    """Canonical images (rows, columns): attenuation (no unit) and path through the lesion in mm."""

    attenuation: Image
    lesion_mm: Image

    @property
    def lesion_mask(self) -> NDArray[np.bool_]:
        """The lesion's shadow, without detached pixels."""
        labels, count = ndimage.label(self.lesion_mm > LESION_PATH_MM)
        sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
        return np.asarray(labels == 1 + int(sizes.argmax())) if count else np.zeros(labels.shape, dtype=bool)


def attenuation(tissue: Tissue) -> NDArray[np.float32]:
    """Linear attenuation (N,) at 20 keV, 1/mm."""
    by_kind = np.zeros(6, dtype=np.float32)
    by_kind[[AIR, SOFT, SKIN, MUSCLE, RIB, LUNG]] = [
        0.0, FAT_PER_MM, SKIN_PER_MM, MUSCLE_PER_MM, MUSCLE_PER_MM, MUSCLE_PER_MM,
    ]  # fmt: skip
    value = by_kind[tissue.kind]
    value += tissue.gland * np.float32(GLAND_PER_MM - FAT_PER_MM)
    return np.asarray(value + tissue.lesion * (np.float32(LESION_PER_MM) - value))


def project(
    view: ViewGeometry,
    tissue_at: Callable[[Array], Tissue],
    medial: tuple[float, float],
    front_p: float,
    pectoral: Pectoral | None = None,
) -> Projection:
    """Line integrals from the source to every pixel, height by height.

    Args:
        view: geometry.
        tissue_at: tissue at places (N, 3) of the breast frame, mm.
        medial: lowest and highest medial plate coordinate of the breast.
        front_p: its foremost posterior coordinate.
        pectoral: muscle that an oblique view shows.
    """
    m = np.arange(medial[0], medial[1] + SPACING_MM, SPACING_MM)
    p = np.arange(front_p, view.edge_p_mm + SPACING_MM, SPACING_MM)
    count = int(np.ceil(view.thickness_mm / SPACING_MM))
    step = view.thickness_mm / count
    sums = np.zeros((2, view.rows, view.columns), dtype=np.float32)
    for k in range(count):
        height = view.height_mm + (k + 0.5) * step
        slab = _slab(view, tissue_at, m, p, height, pectoral)
        rows, columns = _pixel_weights(view, m, p, height)
        sums += np.float32(step) * (rows @ slab @ columns.T)
    sums *= _obliquity(view)
    return Projection(sums[0], sums[1])


def _slab(
    view: ViewGeometry,
    tissue_at: Callable[[Array], Tissue],
    m: Array,
    p: Array,
    height: float,
    pectoral: Pectoral | None,
) -> NDArray[np.float32]:
    """Attenuation and share of lesion (2, len(m), len(p)) at one height."""
    grid = np.stack(np.meshgrid(m, p, [height], indexing="ij"), axis=-1).reshape(-1, 3)
    tissue = tissue_at(plate_to_breast(grid, view.angle_deg))
    if pectoral is not None:
        muscle = pectoral.holds(grid, view) & (tissue.kind == SOFT)
        kind = np.where(muscle, MUSCLE, tissue.kind).astype(np.uint8)
        tissue = Tissue(kind, np.where(muscle, np.float32(0.0), tissue.gland), tissue.lesion)
    return np.stack([attenuation(tissue), tissue.lesion]).reshape(2, len(m), len(p))


def _pixel_weights(view: ViewGeometry, m: Array, p: Array, height: float) -> tuple[Image, Image]:
    """Linear interpolation from a slab's axes to the detector's rows and columns, as matrices."""
    row = np.zeros((view.rows, 2))
    row[:, 1] = np.arange(view.rows)
    column = np.zeros((view.columns, 2))
    column[:, 0] = np.arange(view.columns)
    levels = np.array(height)
    return _hat(view.back_project(row, levels)[:, 0], m), _hat(view.back_project(column, levels)[:, 1], p)


def _hat(places: Array, axis: Array) -> Image:
    """Weights (len(places), len(axis)) of linear interpolation; zero beyond the axis."""
    distance = np.abs(places[:, None] - axis[None, :]) / SPACING_MM
    return np.maximum(1.0 - distance, 0.0).astype(np.float32)


def _obliquity(view: ViewGeometry) -> Image:
    """Length of a beam over its drop in height, for every pixel."""
    row = (np.arange(view.rows) - 0.5 * (view.rows - 1)) * view.pixel_mm
    column = (np.arange(view.columns) + 0.5) * view.pixel_mm
    aside = row[:, None] ** 2 + column[None, :] ** 2
    return np.sqrt(1.0 + aside / view.source_detector_mm**2).astype(np.float32)


def presented(projection: Projection, exposure: Exposure, pixel_mm: float, random: Generator) -> NDArray[np.uint16]:
    """The image that a screen shows (rows, columns): 12 bit, dense tissue bright."""
    primary = np.exp(-projection.attenuation)
    inside = (projection.attenuation > 0.02).astype(np.float32)
    scattered = exposure.scatter * ndimage.gaussian_filter(primary * inside, exposure.scatter_mm / pixel_mm)
    received = ndimage.gaussian_filter(primary + scattered, exposure.blur_mm / pixel_mm)
    counted = received + np.sqrt(received / exposure.photons) * random.standard_normal(received.shape)
    image = -np.log(np.maximum(counted, 1e-4))
    thick = ndimage.gaussian_filter(image * inside, 5.0 / pixel_mm)
    level = float(np.percentile(thick[inside > 0.0], 80.0)) if inside.any() else 0.0
    image = image + inside * exposure.equalisation * np.maximum(level - thick, 0.0)
    bright = np.maximum(image, 0.0) / float(np.percentile(image, 99.9))
    grey = np.round(60.0 + 900.0 * bright + 2900.0 * bright**CONTRAST)
    return np.asarray(np.clip(grey, 0.0, 4095.0), dtype=np.uint16)
