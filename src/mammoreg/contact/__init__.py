"""Contact with rigid plates: distance functions, contact points, augmented-Lagrangian forces and friction."""

from mammoreg.contact.augmented import ContactState, ContactTerms, PlateContact
from mammoreg.contact.plate import Gap, Plate
from mammoreg.contact.surface import ContactSurface

__all__ = ["ContactState", "ContactSurface", "ContactTerms", "Gap", "Plate", "PlateContact"]
