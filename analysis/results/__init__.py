"""Results of an analysis: tables, terminal output, files and the report."""
