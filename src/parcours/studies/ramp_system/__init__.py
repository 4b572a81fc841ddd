"""The paper's section V: RAMP among three obstacles of unforeseen motion, 20 s a case after 1 s of standing obstacles."""
