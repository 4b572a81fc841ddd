"""Whether a message is of the class that its model declares: fields, types and shapes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from parcours.model.structure import MessageClass

_KINDS: dict[str, tuple[type, ...]] = {"bool": (bool,), "int": (int,), "real": (int, float)}
_EXACT: dict[str, type] = {"bool": bool, "int": int, "real": float}


def misfit(
    classes: Mapping[str, MessageClass], declared: MessageClass, message: object, where: str = "it", *,
    whole: bool = False,
) -> str:  # fmt: skip
    """Return the first thing in a message that its class does not allow; empty if there is none.

    A field that is missing is allowed, since not every observer sees all, unless the message must be whole.

    >>> from parcours.model.structure import Field
    >>> state = MessageClass("State", (Field("v", "real"), Field("way", "int", shape=(2,))))
    >>> misfit({}, state, {"v": True})
    'it.v must be real, but is True'
    >>> misfit({}, state, {"v": 1, "way": [1, 2, 3]})
    'it.way must be a list of 2, but is [1, 2, 3]'
    """
    if not isinstance(message, Mapping):
        return f"{where} must be a {declared.name}, but is {message!r:.60}"
    fields = {field.name: field for field in declared.fields}
    for name, value in message.items():
        if name not in fields:
            return f"{where} must be a {declared.name}, which has no {name!r}"
        field = fields[name]
        if wrong := _misfit(classes, field.type, field.shape, value, f"{where}.{name}", whole):
            return wrong
    lacking = [f"{field.name}: {field.type}" for field in declared.fields if field.name not in message] if whole else []
    return f"{where} must be a {declared.name}, but lacks {', '.join(lacking)}" if lacking else ""


def _misfit(
    classes: Mapping[str, MessageClass], kind: str, shape: tuple[int | str, ...], value: object, where: str, whole: bool
) -> str:
    if shape:
        is_list = isinstance(value, list | tuple) or (isinstance(value, Sequence) and not isinstance(value, str))
        if not is_list or (isinstance(shape[0], int) and len(value) != shape[0]):  # type: ignore[arg-type]
            return f"{where} must be a list of {shape[0]}, but is {value!r:.60}"
        items = enumerate(value)  # type: ignore[arg-type, var-annotated]
        wrongs = (_misfit(classes, kind, shape[1:], one, f"{where}[{k}]", whole) for k, one in items)
        return next((wrong for wrong in wrongs if wrong), "")
    if kind in classes:
        return misfit(classes, classes[kind], value, where, whole=whole)
    allowed = _KINDS.get(kind, (str,))
    fits = type(value) in allowed or (isinstance(value, allowed) and (kind == "bool" or not isinstance(value, bool)))
    return "" if fits else f"{where} must be {kind}, but is {value!r:.60}"


def fitting(classes: Mapping[str, MessageClass], declared: MessageClass) -> Callable[[object], bool]:
    """Return what says of messages whether all that they hold is plainly of a class, fast; if not, ask `misfit`."""
    exact = {
        one.name: _EXACT.get(one.type, str) for one in declared.fields if not one.shape and one.type not in classes
    }
    others = {one.name: _shaped(classes, one.type, one.shape) for one in declared.fields if one.name not in exact}

    def fits(message: object) -> bool:
        if type(message) is not dict:
            return False
        for name, value in message.items():
            if type(value) is not exact.get(name):
                test = others.get(name)
                if test is None or not test(value):
                    return False
        return True

    return fits


def _shaped(classes: Mapping[str, MessageClass], kind: str, shape: tuple[int | str, ...]) -> Callable[[object], bool]:
    if shape:
        test, n = _shaped(classes, kind, shape[1:]), shape[0]

        def fits(value: object) -> bool:
            return type(value) is list and (isinstance(n, str) or len(value) == n) and all(map(test, value))

        return fits
    if kind in classes:
        made: list[Callable[[object], bool]] = []  # when a message comes: a class may hold itself

        def fits_class(value: object) -> bool:
            if not made:
                made.append(fitting(classes, classes[kind]))
            return made[0](value)

        return fits_class
    wanted = _EXACT.get(kind, str)
    return lambda value: type(value) is wanted
