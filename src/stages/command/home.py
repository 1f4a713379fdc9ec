"""Where the workflow lies: Snakefile, rules, profiles and configuration."""

from pathlib import Path

from stages.engine.errors import UserError

_PACKAGED = Path(__file__).resolve().parent / "home"
_CHECKOUT = Path(__file__).resolve().parents[3]


def workflow_home() -> Path:
    """Folder of the Snakefile: beside this module where the package was installed, else the checkout's top.

    Raises:
        UserError: neither is there.
    """
    for folder in (_PACKAGED, _CHECKOUT):
        if (folder / "Snakefile").is_file():
            return folder
    raise UserError(f"there is no Snakefile in {_PACKAGED} or {_CHECKOUT}; install mammoreg again")
