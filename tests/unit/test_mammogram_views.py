"""Analysis of views beyond CC and MLO: where the pectoral muscle is sought."""

import numpy as np
import pytest

from mammoreg.imaging.mammogram import analyse
from tests.unit.mammogram_images import PIXEL_MM, breast_image, with_pectoral


@pytest.mark.parametrize("view", ["ML", "LM", "LMO"])
def test_the_muscle_is_found_where_superior_lies_in_each_view(view):
    image = with_pectoral(breast_image())
    expected = analyse(image, PIXEL_MM, "MLO").pectoral
    superior_first = view == "ML"
    found = analyse(image if superior_first else image[::-1], PIXEL_MM, view).pectoral
    assert expected is not None
    assert found is not None
    found = found if superior_first else found[::-1]
    assert np.count_nonzero(found ^ expected) < 0.01 * np.count_nonzero(expected)


@pytest.mark.parametrize("view", ["CC", "XCCL", "XCCM", "FB"])
def test_flat_views_show_no_muscle(view):
    assert analyse(with_pectoral(breast_image()), PIXEL_MM, view).pectoral is None
