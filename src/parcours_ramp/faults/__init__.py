"""RAMP under faults on purpose: a catalogue of faults -> what becomes of the robot, as a table fault x outcome."""
