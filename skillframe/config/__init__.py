"""Tables of TOML and text read strictly into dataclasses, with their units."""

from skillframe.config.load import LARGEST as LARGEST
from skillframe.config.load import build as build
from skillframe.config.load import coerce as coerce
from skillframe.config.load import parse_numbers as parse_numbers
from skillframe.config.load import parse_setting as parse_setting
from skillframe.config.load import read_toml as read_toml

__all__ = ["LARGEST", "build", "coerce", "parse_numbers", "parse_setting", "read_toml"]
