"""A stage's log: what numerics and stages say by the standard library's logging, and what the stage found."""

import logging
import sys
from typing import TextIO

from stages.engine.artefact import Fields
from stages.engine.text import value_lines

PACKAGES = ("mammoreg", "stages")
LOGGER = logging.getLogger(__name__)


def log_to(stream: TextIO) -> None:
    """Send what is logged, and Python's warnings, to a stream; without clock, so that equal jobs log the same."""
    logging.basicConfig(stream=stream, format="%(message)s", force=True)
    for package in PACKAGES:
        logging.getLogger(package).setLevel(logging.INFO)
    logging.captureWarnings(True)


def log_to_terminal() -> None:
    """The same for a stage that is run by hand; only a bug is worth a traceback there."""
    log_to(sys.stderr)
    logging.getLogger("stages.engine.run").setLevel(logging.ERROR)


def log_fields(stage: str, fields: Fields, seconds: float) -> None:
    """Log how a stage ended, how long it took and the values that it found."""
    ended = f"{fields.status}: {fields.message}" if fields.message else fields.status
    LOGGER.info("%s: %s after %.1f s", stage, ended, seconds)
    for line in value_lines(fields.values):
        LOGGER.info("%s", line)
