"""What ships of `skillframe.run.drive.Drive`, and which one a run takes."""
