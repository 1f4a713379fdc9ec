"""What stage `shape` leaves: the estimated surface, and the breast as it was estimated."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.contact.soft import SoftMemory
from mammoreg.fem.plates.state import DampedState
from stages.compress.record import kept_memory, memory_arrays
from stages.engine.artefact import Array, Fields, Value
from stages.engine.record import Record


def shape_fields(nodes: NDArray[np.int64], deformed: Points, state: DampedState, values: Mapping[str, Value]) -> Fields:
    """The artefact's contents.

    Args:
        nodes: numbers (B,) of the nodes whose places are the surface.
        deformed: all nodes (N, 3), plate frame, mm.
        state: of the breast between the plates, of which pressures and contact are kept.
        values: what else was found.
    """
    return Fields(
        arrays={
            "surface_nodes": Array(nodes, "1", "numbers of the mesh nodes on the skin, and of the back on the plates"),
            "surface": Array(deformed[nodes], "mm", "estimated places of these nodes, plate frame", "plate"),
            "deformed": Array(deformed, "mm", "all mesh nodes as the surface was estimated, plate frame", "plate"),
            "pressure": Array(state.pressure, "kPa", "element pressures there, positive in tension"),
            **memory_arrays(state.memory),
        },
        values=values,
    )


class ShapeRecord(Record):
    """The estimated surface."""

    @property
    def surface_nodes(self) -> NDArray[np.int64]:
        """Numbers (B,) of the mesh nodes on the surface."""
        return self.artefact.array("surface_nodes", "1")

    @property
    def surface(self) -> Points:
        """Their places (B, 3), plate frame, mm."""
        return self.artefact.array("surface", "mm")

    @property
    def deformed(self) -> Points:
        """All nodes (N, 3), plate frame, mm."""
        return self.artefact.array("deformed", "mm")

    @property
    def pressure(self) -> NDArray[np.float64]:
        """Element pressures (E,), kPa, positive in tension."""
        return self.artefact.array("pressure", "kPa")

    @property
    def memory(self) -> SoftMemory:
        """What contact points remember."""
        return kept_memory(self.artefact)
