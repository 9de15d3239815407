"""Reports: self-contained HTML, made from files alone."""
