"""Bodies whose surface is prescribed: the updated boundary conditions, the cube, linear elasticity."""
