"""What an analysis tells: tables, terminal, files, report."""
