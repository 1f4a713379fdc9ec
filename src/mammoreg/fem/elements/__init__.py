"""Hexahedra with a pressure each: kinematics, residual and tangent of a hyperelastic body."""
