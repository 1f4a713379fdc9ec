"""Whether all mammograms of a case are of another size than its MR breast, as one wrong pixel spacing makes them."""

from collections.abc import Sequence

import numpy as np

ODD_MEAN = (0.82, 1.085)
"""Geometric mean of the views' relative sizes beyond which a case is flagged; 0.86 to 1.04 in the 14 cases of known
size with two views (twins, standing, embedded), where one view may have 0.81 or 1.05. Wide below, where a model that is
cut off behind looks as an image that is too large does."""


def size_doubts(sizes: Sequence[float | None]) -> list[str]:
    """What the views say together, whose own errors partly cancel; nothing of fewer than two.

    Args:
        sizes: how many times as large as its outline each view's compressed silhouette is; None where unknown.
    """
    known = [size for size in sizes if size is not None]
    if len(known) < 2:
        return []
    mean = float(np.exp(np.mean(np.log(known))))
    if ODD_MEAN[0] <= mean <= ODD_MEAN[1]:
        return []
    off = f"{abs(1.0 / mean - 1.0):.0%} {'smaller' if mean > 1.0 else 'larger'}"
    return [f"all mammograms show a breast {off} than the MR volume's: check their pixel spacing and thickness"]
