"""A skill as a file: how it is named, read, written and exported."""
