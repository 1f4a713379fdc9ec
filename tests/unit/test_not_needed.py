"""What a scene does not need is not computed: it is made to fail here, and the scene is solved without noticing.

Each test also shows that the scene that does need it would notice. (That homogeneous tissue asks for no tissue map is
shown with stage `compress`, tests/stages/test_compress.py.)
"""

from typing import Any, NoReturn

import numpy as np
import pytest

from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact
from mammoreg.contact.surface import ContactSurface
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.linear.direct import PardisoSolver, SuperLuSolver
from mammoreg.fem.parts.back import held_back
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.prescribed.linear_elastic import LinearElasticBody
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.fem.skin.membrane import Membrane
from mammoreg.fem.skin.models import SkinName, skin_model
from mammoreg.materials.elastic import ElasticMaterial, hyperelastic, neo_hookean
from mammoreg.materials.exponential import Exponential
from mammoreg.materials.fibres import Fibres
from mammoreg.materials.neo_hookean import NeoHookean
from tests.unit.fe_bodies import block

QUICK = ClosingOptions(steps=2, tolerance_mm=0.5, rests=2, contact_factors=())


class NotNeededError(Exception):
    """Something was computed that should not have been."""


def forbid(monkeypatch: pytest.MonkeyPatch, owner: type, *names: str) -> None:
    def fail(*_: Any, **__: Any) -> NoReturn:
        raise NotNeededError

    for name in names:
        monkeypatch.setattr(owner, name, fail)


def body(material: ElasticMaterial | None = None) -> HyperelasticModel:
    mesh = block(2)
    return HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0) if material is None else material)


def pulled(model: HyperelasticModel) -> None:
    """One face held, the opposite one moved."""
    back, front = (np.flatnonzero(sign * model.points[:, 1] > 29.9) for sign in (1.0, -1.0))
    targets = model.points[front] - [0.0, 3.0, 0.0]
    solve_prescribed(model, front, targets, held_back(back, np.ones(3, dtype=bool)))


def squeezed(friction: float = 0.0, skin: SkinName = "none", material: ElasticMaterial | None = None) -> Closed:
    model, mesh = body(material), block(2)
    back = held_back(mesh.back_nodes(), np.array([True, True, False]))
    cover = skin_model(skin, model, mesh.skin_quads())
    closing = Closing(
        model,
        cover.contact_quads,
        back,
        friction=friction,
        options=QUICK,
        parts=cover.parts,
        extra_nodes=cover.extra_nodes,
    )
    return closing.close(50.0)


def test_no_contact_is_searched_without_plates(monkeypatch: pytest.MonkeyPatch) -> None:
    forbid(monkeypatch, Plate, "gap", "first_touch")
    forbid(monkeypatch, ContactSurface, "__init__", "positions")
    pulled(body())
    with pytest.raises(NotNeededError):
        squeezed()


def test_no_friction_is_kept_without_friction(monkeypatch: pytest.MonkeyPatch) -> None:
    forbid(monkeypatch, SoftContact, "_friction", "_friction_energy", "_relative")
    memory = squeezed().state.memory
    assert [array.size for array in (memory.anchor, memory.traction, memory.pressure, memory.shift)] == [0, 0, 0, 0]
    with pytest.raises(NotNeededError):
        squeezed(friction=0.3)


def test_no_skin_has_elements_without_skin(monkeypatch: pytest.MonkeyPatch) -> None:
    forbid(monkeypatch, Membrane, "__init__", "terms")
    closed = squeezed()
    assert closed.extra is None
    for skin in ("attached", "sliding", "adherent"):
        with pytest.raises(NotNeededError):
            squeezed(skin=skin)


def test_no_fibres_and_no_curvature_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A neo-Hookean tangent has no term of W'', and tissue without fibres none of theirs."""
    forbid(monkeypatch, NeoHookean, "slope_kpa", "curvature_kpa")
    forbid(monkeypatch, Exponential, "_curvature")
    forbid(monkeypatch, Fibres, "slope_kpa", "curvature_kpa")
    pulled(body())
    with pytest.raises(NotNeededError):
        pulled(body(hyperelastic(Exponential(4.46, 7.4))))
    with pytest.raises(NotNeededError):
        pulled(body(neo_hookean(10.0, 0.49, np.array([0.0, 1.0, 0.0]), 5.0)))


def test_linear_problem_is_one_system_for_all_its_loads() -> None:
    model = body()
    held = np.repeat((model.points[:, 1] > 29.9)[:, None], 3, axis=1)
    linear, loads = LinearElasticBody(model, held), np.random.default_rng(0).standard_normal((3, *model.points.shape))
    one, other, both = (linear.solve(force=load).displacement for load in (loads[0], loads[1], loads[0] + loads[1]))
    np.testing.assert_allclose(one + other, both, atol=1e-9 * np.abs(both).max())
    assert linear.factorisations == 1


def test_pattern_is_analysed_once_for_a_whole_compression(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    for kind in (PardisoSolver, SuperLuSolver):
        plain = kind.__init__

        def counted(self: Any, *arguments: Any, _plain: Any = plain, **named: Any) -> None:
            made.append(type(self))
            _plain(self, *arguments, **named)

        monkeypatch.setattr(kind, "__init__", counted)
    closed = squeezed()
    assert closed.iterations > 2
    assert len(made) == 1
