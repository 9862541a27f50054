"""The draft of a map, from the headings and the cells of tables made elsewhere."""
