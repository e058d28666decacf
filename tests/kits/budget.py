"""How many examples a property test tries."""

import os

WHOLE = bool(os.environ.get("LIDARCHECK_ALL_EXAMPLES"))


def examples(most: int) -> int:
    """`most` in the whole run (ci/test --all), a third of it elsewhere."""
    return most if WHOLE else max(most // 3, 10)
