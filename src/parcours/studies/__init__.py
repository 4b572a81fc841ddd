"""The studies that ship with Parcours; they come in by the same door as anybody's (entry points `parcours.studies`)."""
