"""Study `stability`: the solver on stiff and extreme scenarios."""
