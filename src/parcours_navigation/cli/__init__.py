"""Commands on planners and on foreign robots (entry points `parcours.commands`), each imported when it is called."""
