"""Worlds made of a user's own parts: two meshes and a `fixture.toml`."""
