"""Component studies: abstract cases of a model, filled with data, enforced on components and judged."""
