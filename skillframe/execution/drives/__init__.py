"""The core's drives, and the choice among them."""
