"""The worlds that ship with the core, one file each: a frozen dataclass of parameters and a function to a scene."""
