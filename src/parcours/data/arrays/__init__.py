"""Goals (which combinations of blocks must stand in a row) become few rows that hold them all, each array verified."""
