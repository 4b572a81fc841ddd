"""The standard topics of a navigation stack, ready-made in the language of bindings (`standard.yaml`)."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from importlib.resources import files

from parcours.model.documents import Mapping as Tree
from parcours.model.documents import Node, read_document

COMMANDS = ("command", "command_stamped")
"""Those on which a stack speaks; on all others it is told of its world."""

ACTIONS = ("navigate",)
"""Those that are no topics, but actions: their messages are goals."""


@functools.cache
def standard_channels() -> Mapping[str, Node]:
    """Return the entry of each standard topic by its key in `stack`, as a binding would have it.

    >>> ", ".join(standard_channels())
    'odometry, tf, scan, map, path, obstacles, obstacle_poses, goal, navigate, command, command_stamped'
    """
    text = (files("parcours.run.binding") / "standard.yaml").read_text(encoding="utf-8")
    document, _ = read_document(text, "standard.yaml")
    assert isinstance(document, Tree)
    return {key.text: node for key, node in document.items}
