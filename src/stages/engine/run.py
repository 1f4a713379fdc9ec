"""The only way in which a stage is executed: by Snakemake, from the shell and in tests."""

import hashlib
import json
import logging
import platform
import shlex
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from stages.engine.artefact import Artefact, Fields, Value, write_artefact
from stages.engine.completion import first_failure
from stages.engine.contract import Inputs, Stage, Subject
from stages.engine.errors import UserError
from stages.engine.failures import Failure, failure_of
from stages.engine.registry import STAGE_MODULES, load_stage, runs_for_one_case, stage_digest
from stages.engine.stage_log import log_fields
from stages.engine.writing import write_bytes

_LOG = logging.getLogger(__name__)
LIBRARIES = ("numpy", "scipy", "scikit-fem", "pypardiso", "mkl", "simpleitk", "scikit-image", "h5py")

InputPaths = Mapping[str, Path | Sequence[Path]]


def run_stage(name: str, inputs: InputPaths, output: Path, settings: Mapping[str, Any], subject: Subject) -> Fields:
    """Run a stage and write its artefact.

    Args:
        name: of the stage.
        inputs: paths by input name; a list where a stage takes one artefact per view or case.
        output: the artefact.
        settings: the stage's section of the configuration.
        subject: case, side and view.

    Returns:
        What the artefact holds.

    Raises:
        UserError: settings or inputs do not fit the stage, or the artefact cannot be written.
    """
    return execute(load_stage(name), stage_digest(name), inputs, output, settings, subject)


def execute(
    stage: Stage, code: str, inputs: InputPaths, output: Path, settings: Mapping[str, Any], subject: Subject
) -> Fields:
    """As `run_stage`, for a stage record and the digest of its code."""
    start = time.perf_counter()
    model = validated(stage, settings)
    opened, ids = _open(stage, inputs)
    fields = _outcome(stage, opened, model, subject)
    log_fields(stage.name, fields, time.perf_counter() - start)
    for name, content in fields.files.items():
        write_bytes(output.parent / (stage.folder or stage.name) / name, content)
    write_artefact(output, _header(stage, code, ids, model, subject), fields)
    return fields


def validated(stage: Stage, settings: Mapping[str, Any]) -> BaseModel:
    """The stage's settings as its model.

    Raises:
        UserError: a key is unknown or a value not permitted; all of them are listed.
    """
    try:
        return stage.settings.model_validate(dict(settings))
    except ValidationError as error:
        lines = [f"{stage.name}.{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
        raise UserError("settings are not valid:\n  " + "\n  ".join(lines)) from error


def command_line(name: str, inputs: InputPaths, output: Path, settings: Mapping[str, Any], subject: Subject) -> str:
    """The shell command that runs the same stage by hand, from whatever folder it is pasted in."""
    words = [sys.executable, "-m", "stages", "run", name, "--case", subject.case, "--laterality", subject.laterality]
    if subject.view:
        words += ["--view", subject.view]
    for key, text in subject.row.items():
        words += ["--row", f"{key}={text}"]
    for key, paths in inputs.items():
        for path in _listed(paths):
            words += ["--in", f"{key}={path}"]
    if settings:
        words += ["--settings", json.dumps(settings)]
    return f"cd {shlex.quote(str(Path.cwd()))} && {shlex.join([*words, '--out', str(output)])}"


def _open(stage: Stage, inputs: InputPaths) -> tuple[Inputs, dict[str, list[str]]]:
    known = {*stage.inputs, *stage.optional}
    given = {name: _listed(paths) for name, paths in inputs.items() if _listed(paths)}
    if unknown := sorted(set(given) - known):
        raise UserError(f"{stage.name} takes no input {', '.join(unknown)}; it takes {', '.join(sorted(known))}")
    if missing := [name for name in stage.inputs if name not in given]:
        raise UserError(f"{stage.name} needs the input {', '.join(missing)}; give it with --in name=path")
    for name, path in ((name, path) for name, paths in given.items() for path in paths):
        if not path.exists():
            raise UserError(f"{stage.name}, input {name}: there is no file {path}")
    artefacts = {n: [Artefact(path) for path in paths] for n, paths in given.items() if n in STAGE_MODULES}
    files = {name: paths[0] for name, paths in given.items() if name not in STAGE_MODULES}
    ids = {name: [a.attrs["artefact_id"] for a in found] for name, found in artefacts.items()}
    ids |= {name: [content_id(path)] for name, path in files.items()}
    return Inputs(files, artefacts), dict(sorted(ids.items()))


def _listed(paths: Path | Sequence[Path]) -> list[Path]:
    return [paths] if isinstance(paths, Path) else list(paths)


def content_id(path: Path) -> str:
    """SHA-256 of a file's bytes, or of a folder's file names and bytes; the same wherever it lies."""
    digest = hashlib.sha256()
    members = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    for member in members:
        digest.update(f"{member.relative_to(path) if path.is_dir() else ''}\0".encode())
        with member.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def _outcome(stage: Stage, inputs: Inputs, settings: BaseModel, subject: Subject) -> Fields:
    """What the stage comes to, or in its place the failure, of an input or its own, that later stages carry on."""
    given = (artefact for found in inputs.stages.values() for artefact in found)
    failure = None if stage.takes_failed else first_failure(given)
    if failure is not None:
        return _without_result(stage, inputs, failure)
    try:
        return stage.run(inputs, settings, subject)
    except Exception as error:
        failure = failure_of(error, stage.name, subject.view or "", of_one_case=runs_for_one_case(stage.name))
        if failure is None:
            raise
        # A user's log tells of bad data too; on a terminal only a bug is worth a traceback.
        _LOG.log(logging.ERROR if failure.status == "bug" else logging.INFO, "%s", failure, exc_info=True)
        return _without_result(stage, inputs, replace(failure, message=_without_folders(failure.message, inputs)))


def _without_result(stage: Stage, inputs: Inputs, failure: Failure) -> Fields:
    """The failure, with the rows that name what could not be had."""
    values: Mapping[str, Value] = {}
    try:
        values = stage.without_result(inputs, failure) if stage.without_result else {}
    except Exception:
        _LOG.exception("%s cannot name what is missing", stage.name)
    return Fields(values=values, failure=failure)


def _without_folders(message: str, inputs: Inputs) -> str:
    """A message without the folders of the inputs: artefacts hold no absolute path."""
    for path in inputs.files.values():
        message = message.replace(f"{path.parent}/", "")
    return message


def _header(
    stage: Stage, code: str, ids: Mapping[str, list[str]], settings: BaseModel, subject: Subject
) -> dict[str, str]:
    header = {
        "stage": stage.name,
        "schema": str(stage.schema),
        "case": subject.case,
        "view": subject.view or "",
        "laterality": subject.laterality,
        "row": json.dumps(dict(sorted(subject.row.items()))),
        "package_version": _version("mammoreg"),
        "software": json.dumps({"python": platform.python_version()} | {name: _version(name) for name in LIBRARIES}),
        "code": code,
        "settings": settings.model_dump_json(),
        "inputs": json.dumps(ids),
        "frame": "LPS, mm",
    }
    return header | {"artefact_id": hashlib.sha256(json.dumps(header).encode()).hexdigest()}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
