"""What went wrong first in a case, told by type: which stage, in which view, how, and the message for the user."""

import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mammoreg.errors import DataError, NotConvergedError
from stages.engine.errors import UserError

Status = Literal["ok", "not_converged", "failed", "bug"]


@dataclass(frozen=True)
class Failure:
    """The origin of a result that did not end well; later stages pass it on unchanged.

    Attributes:
        stage: that failed first.
        view: of that stage, empty where it runs once for a case.
        status: `failed` (data), `not_converged` (numerics) or `bug`.
        message: what is wrong, where, and the remedy.
    """

    stage: str
    view: str
    status: Status
    message: str

    def __str__(self) -> str:
        return f"{self.stage}: {self.message}"

    @property
    def where(self) -> str:
        """Stage and view in words."""
        return f"{self.stage} {self.view}".rstrip()


def failure_of(error: Exception, stage: str, view: str, *, of_one_case: bool) -> Failure | None:
    """What an exception in a stage is to its case; None if it is to be raised again.

    Bad data and numerics without an answer are results of any stage. In a stage of one case everything else is one
    too, so that no case costs the others their tables; but want of memory is not, for the workflow tries with more.
    """
    if isinstance(error, DataError):
        return Failure(stage, view, "failed", str(error))
    if isinstance(error, NotConvergedError):
        return Failure(stage, view, "not_converged", str(error))
    if isinstance(error, MemoryError) or not of_one_case:
        return None
    if isinstance(error, UserError):
        return Failure(stage, view, "failed", str(error))
    if isinstance(error, OSError) and error.filename and error.strerror:
        return Failure(stage, view, "failed", f"{Path(str(error.filename)).name}: {error.strerror}; {_TRY_AGAIN}")
    # Not the exception's own text, which may hold paths and whatever stood in a header.
    return Failure(stage, view, "bug", f"stopped by a bug ({type(error).__name__} in {_place(error)}); {_REPORT}")


_TRY_AGAIN = "mend it, delete this stage's artefact and run again"
_REPORT = "please report it with the traceback in the stage's log"


def _place(error: Exception) -> str:
    """Module and function in which an exception was raised, of this project if it passed through it."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    modules = [(str(frame.f_globals.get("__name__", "")), frame.f_code.co_name) for frame in frames]
    own = [pair for pair in modules if pair[0].split(".")[0] in ("mammoreg", "stages") and pair[0] != _ENGINE]
    module, function = (own or modules or [("an unknown place", "")])[-1]
    return f"{module}.{function}".rstrip(".")


_ENGINE = "stages.engine.run"
