"""Finite elements: nearly incompressible hyperelastic hexahedra, compression between plates, prescribed skin.

Typical use, all in the plate frame (medial, posterior, height)::

    model = HyperelasticModel(points, hexes, neo_hookean(9.4, poisson=0.495))
    back = back_condition("slide_compression", points, back_quads)
    closed = Closing(model, skin_quads, back, edge_p_mm=edge).close(gap_mm)
    updated = solve_prescribed(model, skin_nodes, surface, back, closed.deformed, closed.state.pressure)
"""
