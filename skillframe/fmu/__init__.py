"""FMUs: files, builds, instances and banks, in this or in child processes."""
