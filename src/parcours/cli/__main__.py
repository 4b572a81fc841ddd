"""`python -m parcours.cli`."""

from parcours.cli import main

main()
