"""Mutation testing: are the tests that Parcours makes of a study able to see that its system is wrong?"""
