"""Published planners, written for `parcours_navigation.protocol`: ORCA, DWA, MPPI, and two baselines."""
