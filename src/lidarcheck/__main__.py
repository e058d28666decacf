"""`python -m lidarcheck` is `lidarcheck`."""

import sys

from lidarcheck.cli import main

if __name__ == "__main__":
    sys.exit(main())
