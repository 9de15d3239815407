"""skillframe plug-in: the shipped worlds, each a frozen dataclass of parameters and a function to a scene."""
