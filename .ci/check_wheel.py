"""Refuse a wheel that lacks any file of the packages, or the prebuilt libraries."""

import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
(wheel,) = sys.argv[1:]
held = set(zipfile.ZipFile(wheel).namelist())
wanted = {
    path.relative_to(ROOT).as_posix()
    for package in ("fmus", "gfor_fmu", "orchestrator")
    for path in (ROOT / package).rglob("*")
    if path.is_file()
    and "__pycache__" not in path.parts
    and path.suffix != ".png"  # pictures of pages
}
missing = sorted(wanted - held)
if missing:
    sys.exit(f"{wheel} lacks {len(missing)} files: {', '.join(missing)}")
prebuilt = [name for name in held if "/prebuilt/" in name]
if len(prebuilt) < 3:
    sys.exit(f"{wheel} brings no prebuilt libraries")
print(
    f"{wheel}: {len(held)} files, {Path(wheel).stat().st_size / 1e6:.1f} MB, {len(prebuilt)} prebuilt libraries"
)
