"""Stage `figures`: pictures and exports of a case."""
