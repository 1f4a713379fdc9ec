"""The linear system of a Newton iteration: assembly, direct solver, and the iterative path of large meshes."""
