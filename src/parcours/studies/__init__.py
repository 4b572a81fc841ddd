"""Studies: each joins models, input domains, a system under test and oracles. Users write their own the same way."""
