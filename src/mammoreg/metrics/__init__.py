"""Measures of a registration (contract, Measures) and the paper's own results."""
