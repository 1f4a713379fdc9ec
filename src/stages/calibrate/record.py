"""What other stages read of stage `calibrate`."""

from stages.engine.record import Record


class CalibrateRecord(Record):
    """The scale of the tissue."""

    @property
    def mu_kpa(self) -> float:
        """Shear modulus of the homogeneous tissue."""
        return float(self.artefact.value("mu_kpa"))
