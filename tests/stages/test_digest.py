"""The code digest: what changes it and what does not."""

import pytest

from stages.engine import digest
from stages.engine.digest import SOURCE, module_digest
from stages.engine.registry import STAGE_MODULES


@pytest.fixture
def source(tmp_path):
    """A package of four modules: `a` imports `b`, which imports `c` in a function; nobody imports `d`."""
    package = tmp_path / "stages"
    package.mkdir()
    (package / "__init__.py").write_text('"""Package."""\n')
    (package / "a.py").write_text('"""Doc."""\nfrom stages import b\n\ndef f(x):\n    """Doc."""\n    return b.g(x)\n')
    (package / "b.py").write_text("import numpy\n\ndef g(x):\n    from stages.c import h\n    return h(x)\n")
    (package / "c.py").write_text("def h(x):\n    return x + 1\n")
    (package / "d.py").write_text("def unused():\n    return 1\n")
    return tmp_path


def _after(source, name, old, new):
    before = module_digest("stages.a", source)
    path = source / "stages" / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return before, _anew(source)


def _anew(source):
    """The digest as another process finds it: one reads a file once."""
    for function in vars(digest).values():
        if hasattr(function, "cache_clear"):
            function.cache_clear()
    return module_digest("stages.a", source)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("a.py", '"""Doc."""', '"""Another text."""'),
        ("a.py", "def f(x):", "# a comment\n\n\ndef f( x ):"),
        ("b.py", "def g(x):", "def g(x):  # why"),
        ("d.py", "return 1", "return 2"),
    ],
)
def test_comments_docstrings_layout_and_strangers_change_nothing(source, name, old, new):
    before, after = _after(source, name, old, new)
    assert after == before


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("a.py", "b.g(x)", "b.g(2 * x)"), ("b.py", "h(x)", "-h(x)"), ("c.py", "x + 1", "x + 2")],
)
def test_code_at_any_distance_changes_it(source, name, old, new):
    before, after = _after(source, name, old, new)
    assert after != before


def test_template_that_a_module_names_changes_it(source):
    (source / "stages" / "templates").mkdir()
    template = source / "stages" / "templates" / "page.j2"
    template.write_text("one")
    before, named = _after(source, "a.py", "def f(x):", 'FOLDER = "templates"\n\ndef f(x):')
    assert named != before
    template.write_text("two")
    assert _anew(source) != named


def test_unknown_module(source):
    with pytest.raises(ModuleNotFoundError, match="stages.nothing"):
        module_digest("stages.nothing", source)


def test_every_stage_has_its_own_digest():
    digests = {module_digest(module, SOURCE) for module in STAGE_MODULES.values()}
    assert len(digests) == len(STAGE_MODULES)
