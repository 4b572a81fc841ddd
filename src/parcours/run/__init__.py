"""Cases and a system under test -> traces: the port, its hosts, gated execution, campaigns, results."""
