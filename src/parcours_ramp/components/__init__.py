"""The paper's section IV: interactions of RAMP's components, 67 abstract cases, functional and timing tests."""
