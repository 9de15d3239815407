"""Files that appear complete or not at all: written beside their place, then renamed."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from skillframe.errors import InputError


def replace_file(path: Path, content: bytes) -> None:
    """Write a file by way of a temporary one in the same folder, which is created if need be.

    Raises:
        InputError: the place cannot be written to.
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise InputError(path, f"cannot be written ({error.strerror})", "choose another place for the output") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
