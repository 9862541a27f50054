"""What rings after the corners of a slow burst: its parts, the shapes it has, its peaks."""
