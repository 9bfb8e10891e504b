"""Check what ``make dist`` built: metadata that an index accepts, and nothing left out.

``python tools/check_dist.py dist``.
"""

from __future__ import annotations

import sys
import tarfile
import zipfile
from pathlib import Path, PurePosixPath

from packaging.metadata import Metadata

SOURCES = (
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "LICENSE",
    "Makefile",
    "README.md",
    "SECURITY.md",
    "THIRD_PARTY.md",
    "constraints.txt",
    "docs/conf.py",
    "pyproject.toml",
    "tests/conftest.py",
    "tools/build_binaries.py",
    "tools/play.c",
)
"""What the source distribution must hold, beside src: tests and libraries are made from it."""
PACKAGE = ("src/swashplate/py.typed", "src/swashplate/export/binaries/manifest.toml")


def check_metadata(text: bytes, licences: set[str]) -> None:
    """Every field is valid, there is a description, and the licence files that are named exist."""
    metadata = Metadata.from_email(text, validate=True)
    assert metadata.description, "there is no description: the index would show an empty page"
    assert metadata.description_content_type == "text/markdown"
    assert metadata.license_files, "no licence file is named"
    missing = set(metadata.license_files) - licences
    assert not missing, f"the wheel lacks the licence files {', '.join(sorted(missing))}"


def main(folder: Path) -> None:
    """Check the one wheel and the one source distribution of a folder."""
    (wheel,) = folder.glob("*.whl")
    (sdist,) = folder.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (path,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        licences = {name.partition("/licenses/")[2] for name in names if "/licenses/" in name}
        check_metadata(archive.read(path), licences)
    packaged = {f"src/{name}" for name in names if name.startswith("swashplate/")}
    with tarfile.open(sdist) as archive:
        sources = {
            PurePosixPath(*PurePosixPath(member.name).parts[1:]).as_posix()
            for member in archive.getmembers()
        }
    missing = {*SOURCES, *PACKAGE, *packaged} - sources
    assert not missing, f"{sdist.name} lacks {', '.join(sorted(missing))}"
    assert set(PACKAGE) <= packaged, f"{wheel.name} lacks {', '.join(set(PACKAGE) - packaged)}"
    for file in (wheel, sdist):
        print(f"{file.name}: {file.stat().st_size / 1e6:.2f} MB, as it should be")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
