"""Other people's packages as planners, and our world as theirs: navground, pyrvo, Gymnasium (extra `adapters`)."""
