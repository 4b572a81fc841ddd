"""The paper's whole study, done anew: component and system tests of RAMP, beside the published results."""
