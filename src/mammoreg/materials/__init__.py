"""Material models of breast tissue: constants with their provenance, one-dimensional laws, elastic constants."""
