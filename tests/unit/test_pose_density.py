"""Structure of dense tissue in images and in models."""

import numpy as np
import pytest
from scipy import ndimage

from mammoreg.geometry import ViewGeometry
from mammoreg.pose.density import DensityImage, density_correlation, mammogram_structure, projected_structure

VIEW = ViewGeometry(0.0, 0.0, 0.0, -20.0, 40.0, 650.0, 15.0, 1.0, 160, 100)
CENTRES = np.array([[10.0, -40.0, 0.0], [-20.0, -55.0, 8.0], [15.0, -70.0, -6.0]])


def _mask() -> np.ndarray:
    row, column = np.mgrid[0:160, 0:100]
    return ((row - 79.5) / 60.0) ** 2 + (column / 85.0) ** 2 < 1.0


def _speckle(seed: int) -> np.ndarray:
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(160, 100)), 4.0)
    return (noise / noise.std()).astype(np.float32)


def _structure(pixels: np.ndarray) -> DensityImage:
    return mammogram_structure(pixels.astype(np.float32), _mask(), 1.0)


def _tissue(centres: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of a half ellipsoid 2.5 mm apart; balls of dense tissue in it."""
    axis = np.arange(-80.0, 80.1, 2.5)
    points = np.stack(np.meshgrid(axis, axis, axis[16:48], indexing="ij"), axis=-1).reshape(-1, 3)
    points = points[(points[:, 1] < 0.0) & (((points / [56.0, 80.0, 38.0]) ** 2).sum(axis=1) < 1.0)]
    distance = np.linalg.norm(points[:, None] - centres, axis=2).min(axis=1)
    return points, (distance < 9.0).astype(float)


def _xray(centres: np.ndarray) -> np.ndarray:
    """Lengths of the beams to the pixels within the balls."""
    row, column = np.mgrid[0:160, 0:100]
    low = VIEW.back_project(np.stack([column, row], axis=-1), np.full(row.shape, -60.0))
    ray = VIEW.source - low
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    length = np.zeros(row.shape)
    for centre in centres:
        across = np.linalg.norm(np.cross(centre - low, ray), axis=-1)
        length += 2.0 * np.sqrt(np.clip(81.0 - across**2, 0.0, None))
    return length


def test_structure_ignores_the_scale_and_the_level_of_the_pixels() -> None:
    pixels = _speckle(0)
    assert density_correlation(_structure(pixels), _structure(7.0 * pixels + 300.0)) == pytest.approx(1.0, abs=1e-4)
    assert density_correlation(_structure(pixels), _structure(-pixels)) == pytest.approx(-1.0, abs=1e-4)


def test_structure_ignores_what_varies_slowly() -> None:
    row, column = np.mgrid[0:160, 0:100]
    slope = 3.0 * row / 160.0 + 2.0 * column / 100.0
    assert density_correlation(_structure(_speckle(0)), _structure(_speckle(0) + slope)) > 0.97


def test_unrelated_tissue_does_not_correlate() -> None:
    found = [density_correlation(_structure(_speckle(2 * s)), _structure(_speckle(2 * s + 1))) for s in range(1, 9)]
    assert abs(np.mean(found)) < 0.1
    assert np.abs(found).max() < 0.4


def test_what_lies_outside_the_mask_does_not_matter() -> None:
    pixels = _speckle(3)
    spoilt = np.where(_mask(), pixels, 1e4).astype(np.float32)
    assert density_correlation(_structure(pixels), _structure(spoilt)) == pytest.approx(1.0, abs=1e-6)


def test_rim_is_left_out_but_not_the_chest_wall_edge() -> None:
    mask = _structure(_speckle(0)).mask
    row, column = (index * 2.0 + 0.5 for index in np.nonzero(mask))
    assert (np.hypot((row - 79.5) / 60.0, column / 85.0) < 0.9).all()
    assert mask[40, 0], "tissue goes on behind the edge of the image"


def test_projected_tissue_matches_its_own_xray_and_no_other() -> None:
    points, excess = _tissue(CENTRES)
    image = _structure(_xray(CENTRES))
    model = projected_structure(points, excess, VIEW, image.structure.shape)
    moved = projected_structure(points + np.array([12.0, 0.0, 0.0]), excess, VIEW, image.structure.shape)
    assert density_correlation(model, image) > 0.95
    assert density_correlation(moved, image) < 0.4


def test_too_little_overlap_has_no_correlation() -> None:
    image = _structure(_speckle(0))
    none = DensityImage(image.structure, np.zeros_like(image.mask), image.pixel_mm)
    assert np.isnan(density_correlation(image, none))


def test_image_without_structure_has_no_correlation() -> None:
    image = _structure(_speckle(0))
    flat = DensityImage(np.zeros_like(image.structure), image.mask, image.pixel_mm)
    assert np.isnan(density_correlation(image, flat))
