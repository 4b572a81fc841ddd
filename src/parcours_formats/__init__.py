"""Model files of other tools (docs/formats.md), and PICT models: an add-on by the entry points `parcours.formats`."""

from __future__ import annotations

from parcours.model.formats import Format

_ROOT = r"(?:\s|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>)*<(?:\w+:)?"

FORMATS: dict[str, Format] = {
    "uppaal": Format("UPPAAL XML", (".xml",), "parcours_formats.uppaal", _ROOT + r"nta\b"),
    "scxml": Format("SCXML", (".scxml", ".xml"), "parcours_formats.scxml", _ROOT + r"scxml\b"),
    "graphwalker": Format("GraphWalker JSON", (".json",), "parcours_formats.graphwalker"),
    "graphml": Format("yEd GraphML", (".graphml", ".xml"), "parcours_formats.graphml", _ROOT + r"graphml\b"),
    "dot": Format("Graphviz DOT", (".dot", ".gv"), "parcours_formats.dot"),
    "aut": Format("Aldebaran .aut", (".aut",), "parcours_formats.aut", largest=64_000_000),
    "plantuml": Format(
        "PlantUML state diagram", (".puml", ".plantuml"), "parcours_formats.diagrams:plantuml", reads=False
    ),
    "mermaid": Format("Mermaid state diagram", (".mmd", ".mermaid"), "parcours_formats.diagrams:mermaid", reads=False),
}
"""Name -> format."""
