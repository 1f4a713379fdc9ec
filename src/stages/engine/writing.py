"""Files appear whole or not at all."""

import os
import tempfile
from pathlib import Path

from stages.engine.errors import ArtefactError


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically through a temporary one in the same folder.

    Raises:
        ArtefactError: the file cannot be written.
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise ArtefactError(
            f"{path}: cannot be written ({error.strerror or error}); nothing is left behind: "
            "make room or set the folder's permissions, then run again"
        ) from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
