"""The deformed mesh in three dimensions between the plates."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from numpy.typing import NDArray

from mammoreg.plots.style import PicturedBreast, Png, add_notice, new_figure, to_png

_MARGIN_MM = 8.0
_BAR_MM = 50.0


@dataclass(frozen=True)
class PlatesPicture:
    """One view's mesh between the plates, all in the plate frame, mm.

    Attributes:
        view: name of the view.
        undeformed, deformed: nodes (N, 3).
        skin_quads: node numbers (M, 4) of the outer faces.
        height_mm: lower plate.
        thickness_mm: gap of the plates.
        edge_p_mm: chest-wall edge of the plates.
    """

    view: str
    undeformed: NDArray[np.float64]
    deformed: NDArray[np.float64]
    skin_quads: NDArray[np.int64]
    height_mm: float
    thickness_mm: float
    edge_p_mm: float

    def displacement(self) -> NDArray[np.float64]:
        """Length of the displacement of each outer face's middle (M,), mm."""
        moved = (self.deformed - self.undeformed)[self.skin_quads].mean(axis=1)
        return np.asarray(np.linalg.norm(moved, axis=1))


def deformed_meshes(pictures: Sequence[PlatesPicture], breast: PicturedBreast) -> Png:
    """Per view the undeformed and the compressed mesh, coloured by each face's displacement."""
    with new_figure(8.4, 0.4 + 3.7 * len(pictures), layout=None) as figure:
        figure.subplots_adjust(left=0.01, right=0.84, bottom=0.04, top=0.95, wspace=0.16, hspace=0.06)
        norm = Normalize(0.0, max(1e-6, *(float(picture.displacement().max()) for picture in pictures)))
        for row, picture in enumerate(pictures):
            states = (("undeformed", picture.undeformed), ("between plates", picture.deformed))
            for column, (name, nodes) in enumerate(states):
                place = (len(pictures), 2, 2 * row + column + 1)
                axes = _new_axes(figure, place, f"{breast.laterality} {picture.view}, {name}")
                if name == "between plates":
                    _draw_plates(axes, picture)
                _draw_surface(axes, nodes, picture, norm)
                _set_limits(axes, picture)
                _add_bar(axes)
        beside = figure.add_axes((0.91, 0.25, 0.018, 0.5))
        figure.colorbar(ScalarMappable(norm, colormaps["viridis"]), cax=beside, label="displacement (mm)")
        add_notice(figure, breast, "Model of the breast, plate axes")
        return to_png(figure)


def _new_axes(figure: Figure, place: tuple[int, int, int], title: str) -> Axes3D:
    axes = figure.add_subplot(*place, projection="3d", computed_zorder=False)
    axes.set_title(title, y=0.96)
    axes.patch.set_visible(False)
    for name, label in (("x", "to medial (mm)"), ("y", "to posterior (mm)"), ("z", "to source (mm)")):
        getattr(axes, f"set_{name}label")(label, fontsize=7, labelpad=-4)
        getattr(axes, f"{name}axis").set_pane_color((1.0, 1.0, 1.0, 0.0))
    axes.tick_params(labelsize=6, pad=-2)
    axes.view_init(elev=16, azim=-58)
    return axes


def _draw_surface(axes: Axes3D, nodes: NDArray[np.float64], picture: PlatesPicture, norm: Normalize) -> None:
    """Outer faces in the colour of their displacement, shaded by their direction to the light."""
    surface = Poly3DCollection(
        list(nodes[picture.skin_quads]),
        facecolors=colormaps["viridis"](norm(picture.displacement())),
        edgecolors="#1c1c1c",
        linewidths=0.35,
        shade=True,
        lightsource=LightSource(azdeg=225, altdeg=45),
        zorder=2,
    )
    axes.add_collection3d(surface)


def _draw_plates(axes: Axes3D, picture: PlatesPicture) -> None:
    """The lower plate behind the breast and the upper one before it, both ending at the chest-wall edge."""
    (left, front, _), (right, _, _) = _limits(picture)
    back = picture.edge_p_mm
    for zorder, height in ((1, picture.height_mm), (3, picture.height_mm + picture.thickness_mm)):
        corners = [(left, front, height), (right, front, height), (right, back, height), (left, back, height)]
        style = {"facecolors": "#7fb3e6", "alpha": 0.22, "edgecolors": "#33567a", "linewidths": 0.8}
        axes.add_collection3d(Poly3DCollection([corners], zorder=zorder, **style))


def _limits(picture: PlatesPicture) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    both = np.concatenate([picture.undeformed, picture.deformed])
    return both.min(axis=0) - _MARGIN_MM, both.max(axis=0) + _MARGIN_MM


def _set_limits(axes: Axes3D, picture: PlatesPicture) -> None:
    """The same cuboid, in true proportions, for both states of a view."""
    low, high = _limits(picture)
    for name, start, end in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{name}lim")(start, end)
    axes.set_box_aspect(tuple(high - low), zoom=1.08)


def _add_bar(axes: Axes3D) -> None:
    """A bar along the lower front edge of the box."""
    left, front, low = axes.get_xlim()[0], axes.get_ylim()[0], axes.get_zlim()[0]
    start = left + 4.0
    axes.plot([start, start + _BAR_MM], [front, front], [low, low], color="black", lw=2.4, zorder=4)
    axes.text(start, front, low + 4.0, f"{_BAR_MM:g} mm", fontsize=7, zorder=4)
