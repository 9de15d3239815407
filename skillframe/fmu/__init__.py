"""FMUs: files, builds, instances and banks of them, in this process or in child processes. No oil here."""
