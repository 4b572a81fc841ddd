"""A case and its trace become pass, fail, inconclusive or error, and why; verdicts become rates."""
