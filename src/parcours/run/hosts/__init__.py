"""What runs components: the same components under the same rules, on a simulated or on the real clock."""
