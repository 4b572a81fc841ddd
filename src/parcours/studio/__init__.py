"""A page in the browser on one folder: edit models and studies, generate, run, watch, step through a case, compare."""
