"""The cube test (paper, section II-B, Table I): force that compresses a cube of tissue between smooth plates."""

from dataclasses import dataclass

from mammoreg.materials.laws import Law, NeoHookean

CUBE_MM3 = 240e3
LOW_COMPRESSION, HIGH_COMPRESSION = 0.21, 0.50


@dataclass(frozen=True)
class ForceRange:
    """Forces measured in mammography, N (Sullivan, after the paper: 560 patients)."""

    lowest_n: float = 49.0
    median_n: float = 127.0
    highest_n: float = 186.0

    def holds(self, force_n: float) -> bool:
        """Whether a force lies in the range."""
        return self.lowest_n <= force_n <= self.highest_n

    @property
    def ratio(self) -> float:
        """Highest over lowest force."""
        return self.highest_n / self.lowest_n


SULLIVAN = ForceRange()


def cube_force_n(law: Law, compression: float, volume_mm3: float = CUBE_MM3) -> float:
    """Force in N that compresses a cube of a volume by a share of its height."""
    face_mm2 = volume_mm3 ** (2.0 / 3.0)
    return float(law.stress_kpa(compression) * face_mm2) * 1e-3


def mu_for_force_kpa(force_n: float, compression: float) -> float:
    """Shear modulus in kPa of the neo-Hookean cube that needs a force in N at a compression."""
    return force_n / cube_force_n(NeoHookean(1.0), compression)
