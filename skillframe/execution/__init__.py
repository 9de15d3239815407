"""A run: the loop, what stands in it, and what it leaves behind."""
