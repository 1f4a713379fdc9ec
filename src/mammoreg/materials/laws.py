"""The law families of breast tissue, each one-dimensional (paper, Figure 2) and isochoric.

Compression e = 1 - l with the stretch l; nominal stress (force over undeformed area) in kPa, compression positive.
"""

from mammoreg.materials.exponential import Exponential
from mammoreg.materials.hardening import HardenedFat
from mammoreg.materials.linear import Linear
from mammoreg.materials.neo_hookean import NeoHookean
from mammoreg.materials.tabulated import Tabulated

Law = Exponential | NeoHookean | Linear | HardenedFat | Tabulated

__all__ = ["Exponential", "HardenedFat", "Law", "Linear", "NeoHookean", "Tabulated"]
