"""Digital patients: a parametric breast, its compression by another mechanics, and the images made of it."""
