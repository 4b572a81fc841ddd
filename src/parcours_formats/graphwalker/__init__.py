"""GraphWalker's JSON to models and back; its graphs with labels share all but the document (docs/formats-graphs.md)."""

from parcours.model.conversion import Reading, Writing
from parcours.model.structure import Cefsm
from parcours_formats.graphwalker.graphwalker_json import document_of, models_in
from parcours_formats.graphwalker.joining import joined
from parcours_formats.graphwalker.labels import Edge, Model, Vertex
from parcours_formats.graphwalker.parting import parted
from parcours_formats.naming import as_label, stem

__all__ = ["Edge", "Model", "Vertex", "joined", "parted", "read", "write"]


def read(text: str, origin: str) -> Reading:
    """Return the model that GraphWalker's JSON holds.

    Args:
        text: the file.
        origin: its name, for messages; the model is called as the file, or as its only graph.

    Raises:
        BadModel: the text is no such JSON, or says what our language cannot.

    Example:
    >>> reading = read('''{"models": [{"name": "Door", "startElementId": "n0", "actions": ["n = 0;"],
    ...   "vertices": [{"id": "n0", "name": "v_Open"}, {"id": "n1", "name": "v_Shut"}],
    ...   "edges": [{"id": "e0", "name": "e_Shut", "sourceVertexId": "n0", "targetVertexId": "n1",
    ...              "guard": "n < 3", "actions": ["n++;"]}]}]}''', "door.json")
    >>> from parcours.model import predicate
    >>> [f"{each.id} {predicate(each)}" for each in reading.cefsm.component("Door").transitions()]
    ['e_Shut (-/[n < 3]/n := n + 1/-)']
    """
    name, models, losses = models_in(text, origin)
    name = name or (models[0].name if len(models) == 1 else stem(origin))
    return joined(models, as_label(name), origin, losses)


def write(cefsm: Cefsm) -> Writing:
    """Return a model as GraphWalker's JSON: each machine is a graph; messages are left out."""
    models, losses = parted(cefsm)
    return Writing(document_of(cefsm.name, models), losses)
