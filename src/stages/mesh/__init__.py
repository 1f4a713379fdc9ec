"""Stage `mesh`: the breast as a block of hexahedra."""
