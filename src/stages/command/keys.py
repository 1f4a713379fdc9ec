"""Keys of the configuration as a user gives them to the command: a file, and `--set key=value`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stages.engine.errors import UserError

_PATHS = ("cases", "views", "stability_scan")


def key_values(file: Path | None, pairs: Sequence[str]) -> dict[str, Any]:
    """Configuration values by key, sections nested; a pair overrides the file.

    Args:
        file: YAML.
        pairs: `key=value` with dots between a section and its key; values as YAML writes them.

    Raises:
        UserError: the file or a pair cannot be read.
    """
    values = _read(file) if file is not None else {}
    for pair in pairs:
        key, sign, text = pair.partition("=")
        if not sign or not all(key.split(".")):
            raise UserError(f"--set {pair}: is no key and value; write --set mesh.elements=10")
        *sections, last = key.split(".")
        place = values
        for section in sections:
            place = place.setdefault(section, {})
            if not isinstance(place, dict):
                raise UserError(f"--set {pair}: {section} is a value, no section")
        place[last] = _yaml(text, f"--set {pair}")
    return values


def path_keys_from(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The values with paths, which are relative to the folder that the user is in, made absolute."""
    return {
        key: str(folder / value) if key in _PATHS and isinstance(value, str) else value for key, value in values.items()
    }


def _read(file: Path) -> dict[str, Any]:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is no text in UTF-8"
        raise UserError(f"--config-file {file}: cannot be read ({reason})") from error
    values = _yaml(text, f"--config-file {file}")
    if not isinstance(values, dict | None):
        raise UserError(f"--config-file {file}: holds no keys; write lines such as results: my_results")
    return values or {}


def _yaml(text: str, where: str) -> Any:
    import yaml

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise UserError(f"{where}: cannot be read as YAML ({str(error).replace(chr(10), ' ')})") from error
