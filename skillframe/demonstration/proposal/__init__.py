"""What a foreign table probably holds: the line to type, its reasons, and what its data cannot tell."""
