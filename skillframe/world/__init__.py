"""Worlds: scenes as data, the batched MuJoCo plant, sensors and rates."""
