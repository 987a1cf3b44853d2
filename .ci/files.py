"""Guard the checkout: no large files, no tests that are data, no paths of somebody's machine."""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LARGEST = {"models": 10_000_000, "examples": 2_000_000, "tests": 100_000}  # bytes a file
OTHERS = 200_000
ALL_TESTS = 1_500_000
SKIPPED = re.compile(
    r"(^|/)(\.git|\.venv|venv|build|dist|__pycache__|\.\w+_cache|\.hypothesis)(/|$)"
)
MACHINE = re.compile(r"(?<![\w./-])/(home|Users|root|work|tmp)/[\w.-]+")
TEXT = {".py", ".md", ".toml", ".json", ".csv", ".txt", ".yml", ""}


def main() -> int:
    problems = []
    tests = 0
    for path in sorted(ROOT.rglob("*")):
        name = path.relative_to(ROOT).as_posix()
        if not path.is_file() or SKIPPED.search(name) or ".egg-info/" in name:
            continue
        size = path.stat().st_size
        top = name.split("/")[0]
        tests += size if top == "tests" else 0
        if size > LARGEST.get(top, OTHERS):
            problems.append(f"{name} has {size:,} bytes")
        if path.suffix in TEXT and size < 5_000_000:
            content = path.read_text(encoding="utf-8", errors="replace")
            for number, line in enumerate(content.splitlines(), 1):
                if MACHINE.search(line) and name != ".ci/files.py":
                    problems.append(f"{name}, line {number}: a path of one machine")
    if tests > ALL_TESTS:
        problems.append(f"tests have {tests:,} bytes together")
    print("\n".join(problems) or "ok")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
