"""The simulated world: a robot with limits, disc obstacles, and what is truly so (contact, clearance, goal reached).

The world trusts nobody: it moves the obstacles itself and decides contact with its own geometry, in continuous time.
"""
