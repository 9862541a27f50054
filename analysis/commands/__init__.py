"""The commands `analyze`, `audit`, `dry-run` and `levels`."""
