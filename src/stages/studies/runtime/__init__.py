"""Study `error_vs_runtime`: what more elements buy."""
