"""Print the lowest versions that pyproject.toml allows, as constraints for pip; arguments are extras to include."""

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]
for requirement in [
    *project["dependencies"],
    *(r for e in sys.argv[1:] for r in project["optional-dependencies"][e]),
]:
    if "[" not in requirement:
        print(re.sub(">=", "==", requirement))
