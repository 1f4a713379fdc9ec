"""Numerical settings of plates that close."""

from dataclasses import dataclass

from mammoreg.contact.surface import Rule


@dataclass(frozen=True)
class ClosingOptions:
    """Numerical settings.

    Attributes:
        steps: load steps at least, but for `easy_iterations`; more where a step fails.
        least_step: smallest increment of the load factor before giving up.
        tolerance_mm: Newton iterations end below this; the breast rests when it moves less.
        damping: factor of the damping in load steps.
        rests: steps at rest, several times as many where the breast still moves.
        penalty_per_mm: stiffness of the contact in units of the mean shear modulus while the plates close.
        contact_factors: of that stiffness, one after the other, once the plates have closed.
        band_mm: height of the contact's smooth onset.
        slip_mm: displacement at which friction reaches its limit.
        rule: contact points of a face.
        augmentations: how often at most the contact is augmented at rest; 0: never.
        penetration_mm: the contact is augmented while a point lies deeper in a plate.
        easy_iterations: a load step of at most so many iterations doubles the next one; 0: none does.
    """

    steps: int = 8
    least_step: float = 1.0 / 256.0
    tolerance_mm: float = 0.05
    damping: float = 0.5
    rests: int = 12
    penalty_per_mm: float = 2.0
    band_mm: float = 1.0
    slip_mm: float = 2.5  # chosen for convergence: a smaller one is nearer to Coulomb's law
    rule: Rule = "simpson"
    contact_factors: tuple[float, ...] = (3.0, 10.0)
    augmentations: int = 0
    penetration_mm: float = 0.01
    easy_iterations: int = 0

    @property
    def stiffest(self) -> float:
        """Factor of the contact's stiffness at rest."""
        return self.contact_factors[-1] if self.contact_factors else 1.0


COARSE = ClosingOptions(steps=5, tolerance_mm=0.5, damping=1.0, rests=7, band_mm=2.0)
"""For the search of a pose: answers to some tenths of a millimetre."""
