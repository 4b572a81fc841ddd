"""The comparison: planners run on the same cases become outcomes side by side, paired tests, one page, one document."""
