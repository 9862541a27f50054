"""Whether the record of a session is what the session wrote: heads, tables, all of it."""
