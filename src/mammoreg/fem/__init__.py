"""Finite elements: nearly incompressible hyperelastic hexahedra, compression between plates, prescribed skin.

Typical use, all in the plate frame (medial, posterior, height)::

    model = HyperelasticModel(points, hexes, neo_hookean(9.4, poisson=0.495))
    back = back_condition("slide_compression", points, back_quads)
    result = Compression(model, skin_quads, back, edge_p_mm=edge).solve(gap_mm)
"""

from mammoreg.fem.boundary import BackCondition, back_condition, held_back
from mammoreg.fem.compression import FAST, Compression, CompressionOptions, CompressionResult
from mammoreg.fem.equilibrium import NewtonOptions
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.prescribed import PrescribedOptions, PrescribedResult, solve_prescribed

__all__ = [
    "FAST",
    "BackCondition",
    "Compression",
    "CompressionOptions",
    "CompressionResult",
    "HyperelasticModel",
    "NewtonOptions",
    "PrescribedOptions",
    "PrescribedResult",
    "back_condition",
    "held_back",
    "solve_prescribed",
]
