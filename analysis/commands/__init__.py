"""The commands that analyze data: analyze, audit, columns, demo, dry-run, levels and power."""
