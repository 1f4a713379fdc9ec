"""`python -m mammoreg`: the command, which lies with the stages; no other module of the numerics knows them."""

import sys

from stages.command.main import main

if __name__ == "__main__":
    sys.exit(main())
