"""Commands on RAMP alone (entry points `parcours.commands`), each imported when it is called."""
