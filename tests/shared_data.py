"""Data that lie beside the project, and the visible skip of tests that need them."""

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"
DATA = SHARED / "data"


def requires_shared(folder: str) -> pytest.MarkDecorator:
    """Mark a test (or a module, as `pytestmark`) that reads `../shared/data/<folder>`."""
    return pytest.mark.skipif(not (DATA / folder).exists(), reason=f"no data at ../shared/data/{folder}")
