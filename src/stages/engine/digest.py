"""Digest of the code that a stage depends on: comments and docstrings change nothing, anything else does."""

import ast
import hashlib
import re
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
PACKAGES = ("mammoreg", "stages")


def module_digest(module: str, source: Path = SOURCE) -> str:
    """SHA-256 over the syntax of a module and of all project modules that it imports, directly or not.

    Args:
        module: dotted name of a module below `source`.
        source: folder that holds the packages.
    """
    pending, seen = [module], set[str]()
    while pending:
        name = pending.pop()
        if name not in seen:
            seen.add(name)
            pending.extend(_imports(name, source))
    digest = hashlib.sha256()
    for name in sorted(seen):
        digest.update(_content(name, source))
    return digest.hexdigest()


@cache
def _parse(module: str, source: Path) -> ast.Module:
    path = _file(module, source)
    if path is None:
        raise ModuleNotFoundError(f"no module {module} below {source}")
    return ast.parse(path.read_text(encoding="utf-8"))


def _file(module: str, source: Path) -> Path | None:
    base = source.joinpath(*module.split("."))
    return next((path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()), None)


@cache
def _imports(module: str, source: Path) -> tuple[str, ...]:
    """Project modules that a module imports, with the packages that Python imports on the way."""
    names = set[str]()
    for node in ast.walk(_parse(module, source)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    ours = {name for name in names if name.split(".")[0] in PACKAGES}
    parents = {name.rsplit(".", n)[0] for name in ours | {module} for n in range(1, name.count(".") + 1)}
    return tuple(sorted(name for name in ours | parents if _file(name, source) is not None))


@cache
def _content(module: str, source: Path) -> bytes:
    """What of a module counts: its name, its syntax and the data files that it names."""
    return b"".join(
        [f"{module}\n{_syntax(module, source)}\n".encode(), *map(Path.read_bytes, _data_files(module, source))]
    )


def _data_files(module: str, source: Path) -> list[Path]:
    """Files beside a module that it names in a text constant, such as a folder of templates."""
    path = _file(module, source)
    beside = _data_beside(path.parent if path else source)
    if not beside:
        return []
    texts = {n.value for n in ast.walk(_parse(module, source)) if isinstance(n, ast.Constant) and type(n.value) is str}
    named = [beside[text] for text in sorted(texts & beside.keys())]
    folders, files = [p for p in named if p.is_dir()], [p for p in named if p.is_file()]
    return files + [member for folder in folders for member in sorted(folder.rglob("*")) if member.is_file()]


@cache
def _data_beside(folder: Path) -> dict[str, Path]:
    """Files and folders in a folder, by name, that are no modules and no packages."""
    data = [p for p in folder.iterdir() if re.fullmatch(r"[\w.-]*\w", p.name) and p.name != "__pycache__"]
    return {
        p.name: p
        for p in data
        if (p.is_dir() and not (p / "__init__.py").exists()) or (p.is_file() and p.suffix != ".py")
    }


def _syntax(module: str, source: Path) -> str:
    tree = _parse(module, source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = _without_docstring(node.body)
    return ast.dump(tree)


def _without_docstring(body: list[ast.stmt]) -> list[ast.stmt]:
    first = body[0] if body else None
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
        return body[1:]
    return body
