"""Systems under test that ship with Parcours."""
