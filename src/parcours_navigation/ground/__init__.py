"""The ground a robot drives on: walls, solid bodies and discs, and what is truly so between them and a body."""
