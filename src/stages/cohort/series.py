"""How an MR series is named in all that is written."""

import hashlib


def series_token(text: str) -> str:
    """What stands for the column `mr_series` in artefacts and logs: a number as it is, of a UID a digest."""
    return text if "." not in text else f"uid-{hashlib.sha256(text.encode()).hexdigest()[:12]}"
