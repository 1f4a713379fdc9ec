"""Contact with rigid plates: distance functions, contact points, smooth forces and friction."""
