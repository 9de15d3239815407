"""What ships of `skillframe.execution.drive.Drive`, and which one a run takes."""
