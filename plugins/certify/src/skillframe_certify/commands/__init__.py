"""Commands for certificates, comparisons and real trials."""
