"""Requirements in signal temporal logic, and pass rules: formulas over what a case leaves behind."""
