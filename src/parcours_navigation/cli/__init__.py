"""Commands on planners and on robots of others (entry points `parcours.commands`), each imported when it is called."""
