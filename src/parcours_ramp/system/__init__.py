"""The paper's section V: RAMP among three obstacles of unforeseen motion, 20 s a case after a static second."""
