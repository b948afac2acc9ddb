"""Errors of pydantic in the words of a case: place, value received, remedy.

Depends on: errors.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from cablesim.case.errors import Location, Origin, Problem, short, suggestion

_KINDS = ("kind", "motion", "shape")  # keys that say which of several parts is meant


def explain(error: ValidationError, model: type[BaseModel], origin: Origin) -> list[Problem]:
    """Translate every error of a validation.

    Parameters
    ----------
    error : ValidationError
        What pydantic raised for `model`.
    model : type
        The model of the whole case.
    origin : Origin
        The case as written, with its lines.
    """
    details = error.errors(include_url=False, include_input=True)
    problems = [_explain_one(detail, model, origin) for detail in details]
    # a point with one number of three is reported twice by pydantic: the last says how many it needs
    distinct = {(problem.path, problem.message): problem for problem in problems}
    return sorted(distinct.values(), key=lambda problem: problem.line or 0)


def _explain_one(detail: Any, model: type[BaseModel], origin: Origin) -> Problem:
    kind, context = detail["type"], detail.get("ctx", {})
    place = (*_written_place(detail["loc"], origin.raw), *context.get("at", ()))
    models, field = _models_at(model, detail["loc"])
    if kind in ("missing", "too_long") and detail["loc"] and _too_few_or_many(detail):
        return _explain_count(detail, place, field, origin)
    if kind == "missing":
        place = (*place, detail["loc"][-1])
        described = field.description if field else ""
        return origin.problem(place, "is missing", f"Add `{place[-1]}`: {described}.", received=None)
    if kind == "extra_forbidden":
        known = {name for one in models for name in one.model_fields}
        return origin.problem(place, "is not known here", suggestion(place[-1], known))
    if kind in ("union_tag_not_found", "union_tag_invalid", "kind"):
        return _explain_kind(detail, place, models, origin)
    if kind == "literal_error":
        allowed = [text.strip("' ") for text in context["expected"].replace(" or ", ", ").split(",")]
        return origin.problem(place, "is not one of the choices", suggestion(detail["input"], allowed))
    message, remedy = _plain(kind, context, detail, field)
    return origin.problem(place, message, remedy, received=_received(place, detail, origin))


def _too_few_or_many(detail: Any) -> bool:
    """Tell a row of the wrong length from a missing key."""
    return detail["type"] == "too_long" or isinstance(detail["loc"][-1], int)


def _explain_count(detail: Any, place: Location, field: FieldInfo | None, origin: Origin) -> Problem:
    """Explain a point or a row with too few or too many numbers."""
    if detail["type"] == "missing":
        place = place[: len(place) - 1] if origin.written(place) is ... else place
    written = origin.written(place)
    count = len(written) if isinstance(written, list | tuple) else "the wrong number of"
    needed = detail["ctx"]["max_length"] if detail["type"] == "too_long" else detail["loc"][-1] + 1
    described = f": {field.description}" if field and field.description else ""
    return origin.problem(place, f"has {count} entries", f"Give {needed}{described}.")


def _received(place: Location, detail: Any, origin: Origin) -> str | None:
    """Repeat the value as it was written; what pydantic saw where that is not known."""
    written = origin.written(place)
    if detail["type"] in ("one_of", "channels"):
        return None
    if written is ...:
        written = detail["input"]
    if isinstance(written, dict) and place == ():
        return None
    return short(written)


def _explain_kind(detail: Any, place: Location, models: Iterable[Any], origin: Origin) -> Problem:
    """Explain a part that does not say, or misnames, which of several kinds it is."""
    context = detail["ctx"]
    if detail["type"] == "kind":
        key, known = context["key"], list(context["known"])
    else:
        key = context["discriminator"].strip("'")
        known = sorted({tag for one in models for tag in _tags(one, key)})
    part = detail["input"]
    if not isinstance(part, dict | BaseModel):
        return origin.problem(place, f"is no part with a `{key}`", f"Give `{key}`: {', '.join(known)}.")
    if not isinstance(part, dict) or key not in part:
        remedy = f"Add `{key}`: one of {', '.join(known)}."
        return origin.problem(place, f"does not say its `{key}`", remedy)
    return origin.problem((*place, key), f"is no known `{key}`", suggestion(part[key], known))


def _plain(kind: str, context: Any, detail: Any, field: FieldInfo | None) -> tuple[str, str]:
    """Message and remedy of the simple errors."""
    if "message" in context:
        return context["message"], context.get("remedy", "")
    bounds = {
        "greater_than": ("gt", "must be greater than {}", "above {}"),
        "greater_than_equal": ("ge", "must not be less than {}", "of {} or more"),
        "less_than": ("lt", "must be less than {}", "below {}"),
        "less_than_equal": ("le", "must not be greater than {}", "of {} or less"),
    }
    described = f" ({field.description})" if field is not None and field.description else ""
    if kind in bounds:
        key, message, remedy = bounds[kind]
        bound = f"{context[key]:g}"
        return message.format(bound), f"Give a value {remedy.format(bound)}{described}."
    if kind in ("too_short", "too_long"):
        limit = context.get("min_length", context.get("max_length"))
        return (
            f"has {context['actual_length']} entries",
            f"Give {'at least' if kind == 'too_short' else 'at most'} {limit}{described}.",
        )
    if kind == "invalid_key":
        return "is a key that is not text", "Write keys as text."
    wanted = {
        "string_type": "text",
        "string_too_short": "some text",
        "int_type": "a whole number",
        "bool_type": "true or false",
        "tuple_type": "a list",
        "list_type": "a list",
        "dict_type": "a group of keys",
        "model_type": "a group of keys",
        "model_attributes_type": "a group of keys",
    }.get(kind)
    if wanted:
        return f"is not {wanted}", f"Give {wanted}{described}."
    return detail["msg"], f"See the description of this key{described}."


def _written_place(location: Location, raw: Any) -> Location:
    """Drop from a location of pydantic the union tags, which are not in the file."""
    place: list[str | int] = []
    node = raw
    tagged = False
    for item in location:
        if not tagged and isinstance(node, dict) and item in (node.get(key) for key in _KINDS):
            tagged = True  # a kind that is also the name of a key: `kind: function`, `function: ...`
            continue
        keys = node if isinstance(node, dict) else range(len(node)) if isinstance(node, list | tuple) else ()
        if item not in keys and not isinstance(item, int):
            continue
        node = node[item] if item in keys else None
        tagged = False
        place.append(item)
    return tuple(place)


def _models_at(model: type[BaseModel], location: Location) -> tuple[list[Any], FieldInfo | None]:
    """Models that can stand at a location (for an unknown key: around it), and the last field met."""
    models: list[Any] = [model]
    field: FieldInfo | None = None
    for item in location:
        if isinstance(item, int):
            continue
        if len(models) > 1:
            chosen = [one for one in models if any(item in _tags(one, key) for key in one.model_fields)]
            if chosen:
                models = chosen
                continue
        found = next((one.model_fields[item] for one in models if item in one.model_fields), None)
        if found is None:
            continue
        field = found
        models = list(_models_in(found.annotation)) or models
    return models, field


def _models_in(annotation: Any) -> Iterator[Any]:
    """All models named in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    else:
        for part in get_args(annotation):
            yield from _models_in(part)


def _tags(model: type[BaseModel], key: str) -> tuple[str, ...]:
    """List the literal values of a field, if it is a choice."""
    field = model.model_fields.get(key)
    annotation = None if field is None else field.annotation
    return get_args(annotation) if get_origin(annotation) is Literal else ()
