"""Pictures of a registration, made from arrays; each function returns the bytes of a PNG.

The bytes depend on the arrays alone: no clock, no program version and no screen enters them.
"""
