"""`python -m stages run|check|show|export`: the pipeline's stages and artefacts by hand."""

import sys
from collections.abc import Sequence

from stages.command.main import run_command, stages_parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status is that of `mammoreg`."""
    return run_command(stages_parser(), arguments)


if __name__ == "__main__":
    sys.exit(main())
