"""Stage `solve`: the interior under the estimated surface."""
