"""Read what `snakemake --lint json` says and fail on any finding but the one that does not apply.

Snakemake 9.27 takes the word `json` but prints text: a line `    * <title>:` per finding.
"""

import re
import sys

# Environments come from the locks, not from conda or containers.
EXEMPT = {"Specify a conda environment or container for each rule."}
CLEAN = "Congratulations, your workflow is in a good condition!"


def remaining(report):
    """Lines of a lint report that stand: findings that are not exempt, under the file or rule that they are for."""
    titles = re.findall(r"^    \* (.+):$", report, flags=re.MULTILINE)
    if not titles and CLEAN not in report:
        return [f"no lint report:\n{report}"]
    return [title for title in titles if title not in EXEMPT]


if __name__ == "__main__":
    text = sys.stdin.read()
    found = remaining(text)
    print("\n".join(found) if found else "workflow lint: nothing to mend")
    sys.exit(bool(found))
