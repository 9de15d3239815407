"""Files that are written whole or not at all, documents (TOML, JSON) and npz archives that are read with limits."""

from skillframe.files.whole import remove_temporary as remove_temporary
from skillframe.files.whole import sync_folder as sync_folder
from skillframe.files.whole import write_whole as write_whole
from skillframe.files.whole import writing_whole as writing_whole

__all__ = ["remove_temporary", "sync_folder", "write_whole", "writing_whole"]
