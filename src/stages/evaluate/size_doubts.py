"""Whether all mammograms of a case are of another size than its MR breast, as one wrong pixel spacing makes them.

Where the pixel spacing is too small, so is the outline. The pose hides a part of that: it moves the plates' edge
forward, so that the image shows less of the breast. Silhouette and imaged volume together tell more than either.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

ODD_MEAN = (0.82, 1.085)
"""Geometric mean of the views' relative sizes beyond which a case is flagged; 0.86 to 1.04 in the 14 cases of known
size with two views (twins, standing, embedded), where one view may have 0.81 or 1.05. Wide below, where a model that is
cut off behind looks as an image that is too large does."""
WEIGHT = 0.25
"""Of the imaged share's logarithm beside that of the relative size (chosen; 0.2 to 0.3 tell the same cases apart)."""
SMALLEST_SUM = 0.15
"""Logarithm of the relative size less the weighted one of the imaged share, mean of the views, beyond which the images
are too small; at most 0.125 in the same cases, 0.17 where twin1's pixel spacing is 15 % too small."""


@dataclass(frozen=True)
class ShownSize:
    """What a view tells of its breast's size.

    Attributes:
        relative: how many times as large as the outline the compressed silhouette is; None where unknown.
        share: imaged volume over that of the MR breast; None where unknown.
    """

    relative: float | None
    share: float | None


def size_doubts(views: Sequence[ShownSize]) -> list[str]:
    """What the views say together, whose own errors partly cancel; nothing of fewer than two."""
    known = [(view.relative, view.share) for view in views if view.relative is not None]
    if len(known) < 2:
        return []
    sizes = np.log([relative for relative, _ in known])
    mean = float(np.exp(sizes.mean()))
    off = f"{abs(1.0 / mean - 1.0):.0%} {'smaller' if mean > 1.0 else 'larger'}"
    text = f"all mammograms show a breast {off} than the MR volume's between plates"
    shares = [share for _, share in known if share is not None]
    if not ODD_MEAN[0] <= mean <= ODD_MEAN[1]:
        return [f"{text}: check their pixel spacing and thickness"]
    if len(shares) == len(known) and mean > 1.0 and sizes.mean() - WEIGHT * np.log(shares).mean() > SMALLEST_SUM:
        shown = f"{np.exp(np.log(shares).mean()):.0%}"
        return [f"{text}, and no more than {shown} of its volume: check their pixel spacing and thickness"]
    return []
