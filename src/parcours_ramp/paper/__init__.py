"""The paper's whole study, repeated: component and system tests of RAMP, beside the published results."""
