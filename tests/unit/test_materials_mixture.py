"""Mixtures of tissue, fibres and the material of a body."""

import numpy as np
import pytest

from mammoreg.materials.elastic import bulk_ratio, hyperelastic, tangent_bulk_kpa
from mammoreg.materials.fibres import Fibres
from mammoreg.materials.laws import Exponential, Linear, NeoHookean
from mammoreg.materials.mixture import TissueMixture

FAT, GLAND = Exponential(4.46, 7.4), Linear(48.0)
I1 = np.linspace(3.0, 5.0, 24).reshape(3, 8)


def test_mixture_weighs_energies_by_shares() -> None:
    mixture = TissueMixture((FAT, GLAND), np.array([[1.0, 0.0], [0.25, 0.75], [0.0, 1.0]]))
    for quantity in ("energy_kpa", "slope_kpa", "curvature_kpa"):
        found = getattr(mixture, quantity)(I1)
        fat, gland = (getattr(law, quantity)(I1) for law in (FAT, GLAND))
        expected = np.stack([fat[0], 0.25 * fat[1] + 0.75 * gland[1], gland[2]])
        np.testing.assert_allclose(found, expected)
    np.testing.assert_allclose(mixture.mu_kpa, [FAT.mu_kpa, 0.25 * FAT.mu_kpa + 0.75 * GLAND.mu_kpa, GLAND.mu_kpa])
    np.testing.assert_array_equal(mixture.part(slice(1, 3)).slope_kpa(I1[1:]), mixture.slope_kpa(I1)[1:])


def test_tissue_without_a_share_is_not_evaluated() -> None:
    class Forbidden(NeoHookean):
        def slope_kpa(self, i1: np.ndarray) -> np.ndarray:
            raise AssertionError("evaluated")

    mixture = TissueMixture((FAT, Forbidden(1.0)), np.array([[1.0, 0.0]] * 3))
    np.testing.assert_array_equal(mixture.slope_kpa(I1), FAT.slope_kpa(I1))


@pytest.mark.parametrize(
    ("shares", "message"),
    [
        ([[0.5, 0.4]], "add up"),
        ([[1.0, 0.0], [1.5, -0.5]], "element 1"),
        ([[1.0]], "fractions"),
    ],
)
def test_impossible_shares_are_refused(shares: list[list[float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TissueMixture((FAT, GLAND), np.array(shares))


def test_neo_hookean_tissues_mix_to_a_neo_hookean_body() -> None:
    shares = np.array([[1.0, 0.0], [0.5, 0.5]])
    material = hyperelastic(TissueMixture((NeoHookean(2.0), NeoHookean(20.0)), shares), 0.49).of_elements(2)
    assert material.law is None
    np.testing.assert_allclose(material.mu_kpa, [2.0, 11.0])
    np.testing.assert_allclose(material.bulk_kpa, bulk_ratio(0.49) * material.mu_kpa)
    assert hyperelastic(FAT).of_elements(4).law is FAT


def test_bulk_modulus_follows_the_stiffness_that_is_reached() -> None:
    gland = Exponential(15.1, 12.3)
    initial, final = (tangent_bulk_kpa(gland, compression, 0.495) for compression in (0.0, 0.5))
    assert initial == pytest.approx(gland.mu_kpa * bulk_ratio(0.495))
    assert final == pytest.approx(initial * np.exp(12.3 * 0.5))
    assert final > 5000.0 * gland.mu_kpa


def test_reached_modulus_is_a_third_of_the_slope_in_compression() -> None:
    shares = np.array([[1.0, 0.0], [0.3, 0.7]])
    body = hyperelastic(TissueMixture((FAT, GLAND), shares)).of_elements(2)
    expected = shares @ [float(law.tangent_kpa(0.4)) / 3.0 for law in (FAT, GLAND)]
    np.testing.assert_allclose(body.reached_mu_kpa(0.4), expected, rtol=1e-9)
    np.testing.assert_allclose(body.reached_mu_kpa(1e-4), body.mu_kpa, rtol=1e-3)
    np.testing.assert_array_equal(hyperelastic(NeoHookean(9.0)).of_elements(3).reached_mu_kpa(0.5), np.full(3, 9.0))


@pytest.mark.parametrize("stiffening", [0.0, 0.4, 3.0])
def test_fibre_energy_has_its_derivatives_in_tension_and_none_in_compression(stiffening: float) -> None:
    fibres = Fibres(np.array([0.0, 0.0, 2.0]), 7.0, stiffening).of_elements(2)
    stretch = np.array([[0.5, 0.9, 1.2, 1.9], [2.6, 4.0, 9.0, 40.0]])
    step = 1e-5
    slope = (fibres.energy_kpa(stretch + step) - fibres.energy_kpa(stretch - step)) / (2 * step)
    curvature = (fibres.slope_kpa(stretch + step) - fibres.slope_kpa(stretch - step)) / (2 * step)
    np.testing.assert_allclose(fibres.slope_kpa(stretch), slope, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(fibres.curvature_kpa(stretch), curvature, rtol=1e-6, atol=1e-9)
    assert not fibres.energy_kpa(stretch)[0, :2].any()
    assert np.isfinite(fibres.energy_kpa(np.full((2, 1), 1e4))).all()
    assert (fibres.curvature_kpa(stretch)[0, 2:] >= 7.0).all()


def test_stiffening_fibres_begin_like_plain_ones_and_end_above() -> None:
    plain, stiffening = (Fibres(np.array([1.0, 0.0, 0.0]), 7.0, k2).of_elements(1) for k2 in (0.0, 2.0))
    small, large = np.array([[1.001]]), np.array([[2.0]])
    np.testing.assert_allclose(stiffening.slope_kpa(small), plain.slope_kpa(small), rtol=1e-5)
    np.testing.assert_allclose(stiffening.slope_kpa(large), plain.slope_kpa(large) * np.exp(2.0))


def test_fibres_without_direction_or_with_negative_stiffness_are_refused() -> None:
    with pytest.raises(ValueError, match="length"):
        Fibres(np.zeros(3), 1.0).of_elements(2)
    for fibres in (Fibres(np.ones(3), -1.0), Fibres(np.ones(3), 1.0, -0.1)):
        with pytest.raises(ValueError, match="negative"):
            fibres.of_elements(2)
