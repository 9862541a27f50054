"""What is written and printed for programs: JSON, and the lines of a journal."""
