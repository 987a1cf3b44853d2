"""Run a command and fail if it fails or takes too long (wall time, the best of several runs).

python .ci/timed.py --best-of 5 --at-most 0.4 -- vhquad --help
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--at-most", type=float, required=True, help="seconds")
    parser.add_argument("--best-of", type=int, default=1)
    parser.add_argument("command", nargs="+")
    options = parser.parse_args()
    best = float("inf")
    for attempt in range(options.best_of):
        output = None if attempt == 0 else subprocess.DEVNULL
        began = time.perf_counter()
        subprocess.run(options.command, check=True, stdout=output)
        best = min(best, time.perf_counter() - began)
    verdict = "ok  " if best <= options.at_most else "FAIL"
    print(f"{verdict} {best:.2f} s, at most {options.at_most:g} s: {' '.join(options.command)}")
    return 0 if best <= options.at_most else 1


if __name__ == "__main__":
    sys.exit(main())
