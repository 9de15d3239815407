"""What tells a machine that is broken from one that works: readings, oil and motion that do not fit each other."""
