# SPDX-License-Identifier: MIT
"""Files that are there completely or not at all."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path


def write_files(folder: Path, contents: Mapping[str, str]) -> list[Path]:
    """Write all files under temporary names in folder, made if missing; then rename them.

    contents maps file name to text.  Returns the paths; raises OSError with nothing renamed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    temporary: dict[Path, Path] = {}
    try:
        for name, text in contents.items():
            handle, path = tempfile.mkstemp(prefix=f".{name}.", dir=folder)
            temporary[folder / name] = Path(path)
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
                stream.write(text)
            os.chmod(path, 0o666 & ~_umask())
        for target, path in temporary.items():
            os.replace(path, target)
    finally:
        for path in temporary.values():
            path.unlink(missing_ok=True)
    return list(temporary)


def write_changed(folder: Path, contents: Mapping[str, str]) -> None:
    """As write_files, but files that are as they should be keep their time."""
    changed = {name: text for name, text in contents.items()
               if not (folder / name).is_file()
               or (folder / name).read_text(encoding="utf-8") != text}
    write_files(folder, changed)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
