"""Campaign studies: numbered cases, drawn from input domains, simulated into facts."""
