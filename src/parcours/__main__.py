"""`python -m parcours`: the command line."""

from parcours.cli import main

main()
