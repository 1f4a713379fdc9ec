"""How the workflow follows a user's files, which Snakemake knows as a list of names without braces."""

import hashlib
import re
from pathlib import Path

from stages.cohort.readers.dicom_headers import folder_files


def is_indirect(path: Path) -> bool:
    """Whether what is followed has other names than what the table names: a folder, or a name with braces."""
    return path.is_dir() or _has_braces(path)


def tracked_files(path: Path, links: Path) -> str | list[str]:
    """Names of a file, or of all files of a folder, under which Snakemake can follow their contents.

    Braces in a name would be a wildcard to it; a link without them stands in for such a file.

    Args:
        path: what a table names.
        links: folder for the links; it is made where one is needed.
    """
    if path.is_dir():
        return [_without_braces(file, links) for file in folder_files(path)]
    return _without_braces(path, links)


def _has_braces(path: Path) -> bool:
    return bool(set("{}") & set(str(path)))


def _without_braces(path: Path, links: Path) -> str:
    if not _has_braces(path):
        return str(path)
    target = path.absolute()
    name = hashlib.sha256(str(target).encode()).hexdigest()[:16] + re.sub(r"[{}]", "", "".join(path.suffixes))
    links.mkdir(parents=True, exist_ok=True)
    link = links / name
    if not link.is_symlink():
        link.symlink_to(target)
    return str(link)
