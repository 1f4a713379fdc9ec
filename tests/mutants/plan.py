"""The mutants: which mutation of which case with which seed; the same list on every machine."""

import zlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from tests.mutants.mutations import damage, harmless, mammogram_headers, mammogram_pictures, marks, mr_dicom, mr_nifti
from tests.mutants.mutations import harmless_volumes as volumes
from tests.mutants.mutations import tables as tables_
from tests.mutants.mutations.registry import Mutation

SEED = 9
MODULES = (damage, mammogram_headers, mammogram_pictures, mr_nifti, mr_dicom, marks, tables_, volumes, harmless)


@dataclass(frozen=True)
class Mutant:
    """One mutation of one case.

    Attributes:
        number: of the mutants that differ by their seed alone.
    """

    mutation: Mutation
    base: str
    number: int

    @property
    def name(self) -> str:
        return f"{self.base}: {self.mutation.kind}: {self.mutation.name} ({self.number})"

    def random(self) -> Generator:
        """Its own stream of numbers, which other mutants do not shift."""
        return np.random.default_rng([SEED, zlib.crc32(self.name.encode())])


def mutants(bases: Collection[str]) -> list[Mutant]:
    """All mutants of these cases, those of one case together."""
    found = [
        Mutant(mutation, base, number)
        for module in MODULES
        for mutation in module.MUTATIONS
        for base in mutation.bases
        for number in range(mutation.times)
        if base in bases
    ]
    return sorted(found, key=lambda mutant: mutant.base)


_ANY = 4


def quick_share(found: Sequence[Mutant]) -> list[Mutant]:
    """A fixed share of the mutants that end at `check` or run the last stages alone again, spread over the kinds."""
    cheap = (
        lambda m: m.mutation.kind in ("marks", "tables") and "for the MR volume" not in m.mutation.name,
        lambda m: m.mutation.kind == "damaged bytes" and "lesion" in m.mutation.name,
        lambda m: (
            m.mutation.kind == "mammogram header" and "no number" in m.mutation.name and "Angle" not in m.mutation.name
        ),
        lambda m: m.mutation.kind == "harmless" and m.mutation.name.startswith(("table", "mask of 255 ")),
    )
    return [m for m in found if any(test(m) for test in cheap) and zlib.crc32(m.name.encode()) % _ANY == 0]
