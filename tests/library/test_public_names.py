"""What `import mammoreg` offers, and what it costs."""

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import mammoreg

STUB = Path(mammoreg.__file__).with_suffix(".pyi")


@pytest.mark.parametrize("name", mammoreg.__all__)
def test_every_name_is_there_told_to_checkers_and_explained(name):
    offered = getattr(mammoreg, name)
    assert re.search(rf"\bas {name}\n|^{name}: str$", STUB.read_text(encoding="utf-8"), flags=re.MULTILINE)
    if name != "__version__":
        assert offered.__doc__
        assert getattr(import_module(offered.__module__), name) is offered
        assert f"`{name}`" in (mammoreg.__doc__ or "")


def test_nothing_else_is_offered():
    told = re.findall(r"\bas (\w+)\n", STUB.read_text(encoding="utf-8"))
    assert sorted([*told, "__version__"]) == sorted(mammoreg.__all__)
    with pytest.raises(AttributeError, match="it offers Breast"):
        _ = mammoreg.Lesion  # type: ignore[attr-defined]


def test_import_loads_no_numerics():
    code = "import sys, mammoreg; mammoreg.__version__; print(sorted({m.split('.')[0] for m in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"numpy", "scipy", "skfem", "pydantic", "h5py"} & set(re.findall(r"'(\w+)'", done.stdout))


def test_registration_needs_no_extras():
    code = "import sys, mammoreg; mammoreg.register; print(sorted({m.split('.')[0] for m in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"stages", "pydantic", "h5py", "nibabel", "SimpleITK", "pydicom", "matplotlib", "xarray"} & set(
        re.findall(r"'(\w+)'", done.stdout)
    )
