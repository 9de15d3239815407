"""Worlds: scenes, the batched MuJoCo plant, sensors and rates."""
