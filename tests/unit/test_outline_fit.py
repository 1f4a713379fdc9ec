"""The outline's misfit is that of skin: where the model ends there is nothing to compare."""

from dataclasses import replace

import numpy as np

from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.block import BlockMesh
from mammoreg.metrics.outline_fit import outline_fit
from mammoreg.pose.outline import radial_outline
from mammoreg.pose.silhouette import detector_mm, ray_angles
from tests.unit.block_meshes import half_ellipsoid


def bent_breast() -> BlockMesh:
    """A breast whose back bends forward by 40 mm towards medial and lateral, where the body goes on behind it."""
    mesh = half_ellipsoid(8, (60.0, 85.0, 45.0))
    bend = np.array([0.0, -40.0, 0.0]) * (mesh.points[:, :1] / 60.0) ** 2
    return replace(mesh, points=mesh.points + bend)


def test_outline_fit_leaves_out_where_the_model_ends() -> None:
    """The body goes straight back to the image's edge from where the model, bent forward there, has ended."""
    mesh, view = bent_breast(), ViewGeometry(0.0, -2.0, 0.0, 0.0, 60.0, 650.0, 15.0, 1.0, 200, 130, parallel=True)
    rays = radial_outline(np.array([[1.0, -1.0], [1.0, 1.0]]), np.ones(2), ray_angles(721))
    model = rays.of_model(detector_mm(mesh.points, view), mesh.skin_quads())
    on_skin = np.isfinite(model.radius) & ~model.between(mesh.rim())
    skin = model.points()[on_skin]
    sides = [np.stack([np.linspace(0.0, at[0], 50)[:-1], np.full(49, at[1])], axis=-1) for at in (skin[0], skin[-1])]
    outline = radial_outline(np.concatenate([sides[0], skin, sides[1][::-1]]), np.ones(len(skin) + 98), rays.theta)
    assert model.between(mesh.rim()).sum() > 50
    seen = outline.of_model(detector_mm(mesh.points, view), mesh.skin_quads())
    fit, blind = (outline_fit(outline, seen, rim) for rim in (mesh.rim(), np.zeros(len(mesh.points), dtype=bool)))
    assert fit.p95_mm is not None
    assert fit.p95_mm < 0.1
    assert fit.dice is not None
    assert fit.dice > 0.999
    assert blind.p95_mm is not None
    assert blind.p95_mm > 5.0
