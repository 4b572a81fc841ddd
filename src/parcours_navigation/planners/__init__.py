"""Published planners, written for `parcours_navigation.protocol`: A*, ORCA, DWA, MPPI, MPC, TEB, and two baselines."""
