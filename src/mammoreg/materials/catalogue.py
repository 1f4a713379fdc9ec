"""Material models that the paper compares (section II-B), each constant with where it comes from.

Provenance: `published`, read in a public source that cites the publication, or in the paper; `table_1_implied`, solved
from the paper's Table I; `assumption`, chosen by this project; `memory`, not verified against the publication. Azar's
hardening of fat is not seen in the strains of Table I, where his column is Wellman's: it sets in above them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from mammoreg.materials.laws import Exponential, HardenedFat, Law, Linear, NeoHookean

Provenance = Literal["published", "table_1_implied", "assumption", "memory"]


@dataclass(frozen=True)
class Source:
    """Where a constant comes from."""

    provenance: Provenance
    note: str


@dataclass(frozen=True)
class CatalogueTissue:
    """Law of one tissue; `sources` by the names of the law's constants."""

    law: Law
    sources: Mapping[str, Source]

    @property
    def independent(self) -> bool:
        """Whether no constant was solved from Table I, so that its force can be judged by that table."""
        return all(source.provenance != "table_1_implied" for source in self.sources.values())


@dataclass(frozen=True)
class TissueModel:
    """A material model of the paper.

    Attributes:
        fat, gland: its tissues; the same object where it knows one tissue only.
        table_1: forces that the paper prints for it, N: fat at 21 % and gland at 50 %; empty where it prints none.
    """

    fat: CatalogueTissue
    gland: CatalogueTissue
    table_1: Mapping[str, float] = field(default_factory=dict)


_WELLMAN_MODULUS = "cited from Wellman 1999 in github.com/eloygarcia/RadboudCompression and thesis-Registration"
_FAT_LAW, _GLAND_LAW = Exponential(4.46, 7.4), Exponential(15.1, 12.3)
_WELLMAN_FAT = CatalogueTissue(
    _FAT_LAW,
    {
        "b_kpa": Source("published", f"4.46 kPa {_WELLMAN_MODULUS}"),
        "m": Source("memory", "reproduces Table I exactly"),
    },
)
_WELLMAN_GLAND = CatalogueTissue(
    _GLAND_LAW,
    {
        "b_kpa": Source("published", f"15.1 kPa {_WELLMAN_MODULUS}"),
        "m": Source("table_1_implied", "12.2989 to 12.3000 with b = 15.1 kPa; Azar's tables are said to give 10.0"),
    },
)
_AZAR_FAT = CatalogueTissue(
    HardenedFat(_FAT_LAW, _GLAND_LAW, onset=0.21, b_kpa=4.46, m=12.3),
    {
        "fat.b_kpa": _WELLMAN_FAT.sources["b_kpa"],
        "fat.m": _WELLMAN_FAT.sources["m"],
        "onset": Source("assumption", "where Table I, whose column is Wellman's, ends to speak; Azar's was not found"),
        "b_kpa": Source("assumption", "fat's own initial modulus; Azar's was not found"),
        "m": Source("assumption", "gland's exponent, which keeps fat softer than gland; Azar's was not found"),
    },
)
_FORCES_WELLMAN = {"fat": 9.0, "gland": 2217.0}


def _from_table_1(law: Law, name: str, note: str) -> CatalogueTissue:
    return CatalogueTissue(law, {name: Source("table_1_implied", note)})


def _lorenzen(modulus_kpa: float, allowed: str) -> CatalogueTissue:
    note = f"Table I alone allows {allowed} kPa"
    return CatalogueTissue(Linear(modulus_kpa), {"e_kpa": Source("memory", note)})


_HOMOGENEOUS = CatalogueTissue(
    NeoHookean(10.8), {"mu_kpa": Source("assumption", "least squares to Bakic's linear gland, 60 kPa, over 0 to 50 %")}
)

CATALOGUE: Mapping[str, TissueModel] = {
    "wellman": TissueModel(_WELLMAN_FAT, _WELLMAN_GLAND, _FORCES_WELLMAN),
    "azar": TissueModel(_AZAR_FAT, _WELLMAN_GLAND, _FORCES_WELLMAN),
    "samani": TissueModel(
        _from_table_1(NeoHookean(18.49), "mu_kpa", "+- 0.16 kPa from the rounding"),
        _from_table_1(NeoHookean(37.95), "mu_kpa", "+- 0.04 kPa from the rounding"),
        {"fat": 58.0, "gland": 513.0},
    ),
    "krouskop": TissueModel(
        _from_table_1(Linear(17.3), "e_kpa", "16.65 to 17.88 kPa; constant over strain in the abstract"),
        CatalogueTissue(
            Exponential(20.65, 6.09),
            {
                "b_kpa": Source("table_1_implied", "one-parameter family, anchored at 28 kPa for 5 % (memory)"),
                "m": Source("table_1_implied", "with b = 20.65 kPa"),
            },
        ),
        {"fat": 14.0, "gland": 262.0},
    ),
    "bakic": TissueModel(
        _from_table_1(Linear(48.0), "e_kpa", "47.5 to 48.7 kPa"),
        _from_table_1(Linear(60.0), "e_kpa", "59.8 to 60.3 kPa"),
        {"fat": 39.0, "gland": 116.0},
    ),
    "lorenzen": TissueModel(_lorenzen(1.7, "0.62 to 1.85"), _lorenzen(2.5, "2.33 to 2.85"), {"fat": 1.0, "gland": 5.0}),
    "homogeneous": TissueModel(_HOMOGENEOUS, _HOMOGENEOUS),
}

SKIN = CatalogueTissue(
    Linear(10.0), {"e_kpa": Source("published", "the paper, section II-D, after Samani: constant below 50 % strain")}
)
