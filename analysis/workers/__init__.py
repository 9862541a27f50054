"""Work in chunks: spread over processes or a Dask cluster, and kept in a file."""
