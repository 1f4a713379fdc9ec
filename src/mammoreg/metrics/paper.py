"""The paper's own results, Tables II to VI, for the side of ours.

Source: "Model-based Registration of X-ray Mammograms and MR Images of the Female Breast", sections II-B to II-D
and IV. Distances are in mm, those of lesions from centre to centre, overlaps in percent, as printed. Data set 2 of
Table VI is an estimate from one view.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from mammoreg.metrics.summary import Summary, summarise

METHODS = ("rigid", "plate", "updated")


@dataclass(frozen=True)
class PaperRow:
    """One row of Table V or VI: (distance in mm, overlap in percent) by method.

    Attributes:
        data_set: the paper's number of the patient.
        view: "CC" or "MLO" (the paper's "oblique") in Table V, the views used in Table VI.
    """

    data_set: int
    view: str
    rigid: tuple[float, float]
    plate: tuple[float, float]
    updated: tuple[float, float]

    def of(self, method: str) -> tuple[float, float]:
        """Distance in mm and overlap in percent of a method of `METHODS`."""
        return {"rigid": self.rigid, "plate": self.plate, "updated": self.updated}[method]


TABLE_5 = (
    PaperRow(1, "CC", (20.3, 0.0), (20.4, 0.0), (3.7, 40.7)),
    PaperRow(2, "CC", (25.4, 0.0), (22.9, 0.0), (4.3, 85.7)),
    PaperRow(3, "CC", (29.0, 0.0), (6.0, 80.0), (5.0, 100.0)),
    PaperRow(4, "CC", (24.0, 0.0), (12.2, 10.9), (2.3, 100.0)),
    PaperRow(5, "CC", (6.7, 27.7), (31.0, 0.0), (4.0, 86.7)),
    PaperRow(6, "CC", (36.3, 0.0), (20.3, 0.0), (4.2, 84.6)),
    PaperRow(1, "MLO", (28.1, 0.0), (25.7, 0.0), (6.0, 35.5)),
    PaperRow(3, "MLO", (32.3, 0.0), (22.3, 0.0), (4.4, 83.4)),
    PaperRow(4, "MLO", (14.0, 0.0), (10.8, 10.7), (4.0, 78.0)),
    PaperRow(5, "MLO", (23.9, 0.0), (31.0, 0.0), (3.4, 100.0)),
    PaperRow(6, "MLO", (19.7, 0.0), (14.4, 25.0), (6.0, 100.0)),
)

TABLE_6 = (
    PaperRow(1, "CC+MLO", (86.5, 0.0), (17.4, 2.2), (4.6, 88.9)),
    PaperRow(2, "CC", (25.4, 0.0), (22.9, 0.0), (3.2, 99.6)),
    PaperRow(3, "CC+MLO", (109.5, 0.0), (12.2, 44.0), (5.4, 58.9)),
    PaperRow(4, "CC+MLO", (65.1, 0.0), (6.2, 100.0), (1.6, 100.0)),
    PaperRow(5, "CC+MLO", (81.0, 0.0), (19.4, 15.9), (6.2, 100.0)),
    PaperRow(6, "CC+MLO", (118.3, 0.0), (9.2, 82.4), (2.2, 100.0)),
)


def _landmarks(mean_mm: float, sd_mm: float | None, max_mm: float) -> Summary:
    return Summary(17, 17, mean_mm=mean_mm, sd_mm=sd_mm, max_mm=max_mm)


BEFORE = _landmarks(18.0, None, 26.0)
"""The landmarks between a volunteer's two MR volumes before any simulation."""

TABLE_2: Mapping[str, Summary] = {
    "wellman": _landmarks(3.1, 1.4, 5.1),
    "azar": _landmarks(3.1, 1.3, 5.0),
    "samani": _landmarks(3.1, 1.4, 4.8),
    "homogeneous": _landmarks(3.1, 1.3, 5.0),
    "krouskop": _landmarks(3.1, 1.3, 5.1),
    "bakic": _landmarks(3.3, 1.5, 5.8),
    "lorenzen": _landmarks(3.4, 1.4, 5.7),
}
"""Their distances by material model."""

TABLE_3: Mapping[str, Summary] = {
    "plate": _landmarks(3.1, 1.3, 5.0),
    "additional_points": _landmarks(2.6, 1.3, 4.6),
    "updated": _landmarks(2.7, 1.1, 4.3),
}
"""Their distances by boundary condition; the text gives the additional points' SD as 1.1 mm."""

TABLE_4: Mapping[str, tuple[Summary, Summary]] = {
    "none": (_landmarks(3.4, None, 5.4), _landmarks(2.6, None, 4.7)),
    "attached": (_landmarks(3.3, None, 4.5), _landmarks(2.1, None, 3.5)),
    "sliding": (_landmarks(3.9, None, 5.3), _landmarks(1.8, None, 3.3)),
    "adherent": (_landmarks(3.9, None, 5.4), _landmarks(1.8, None, 3.7)),
}
"""Their distances and lateral distances by skin model."""


def paper_summary(table: tuple[PaperRow, ...], method: str) -> Summary:
    """Statistics of a method's distances in the paper's table; they give the 4.3 (1.0) and 3.9 (1.7) mm of its text."""
    return summarise([row.of(method)[0] for row in table], [row.rigid[0] for row in table])


def paper_overlap_percent(table: tuple[PaperRow, ...], method: str) -> float:
    """Mean overlap of a method in the paper's table."""
    return sum(row.of(method)[1] for row in table) / len(table)
