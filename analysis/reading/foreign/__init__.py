"""Tables made elsewhere: the map that names their columns, and what it says of file and rows."""
