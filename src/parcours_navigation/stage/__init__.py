"""The one driver of a world: a case's whole state in one array, moved from observation to observation."""
