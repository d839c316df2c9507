# SPDX-License-Identifier: Apache-2.0
"""Griffe extension: turns the reStructuredText marks of our docstrings (roles, double backticks, `::`) into Markdown, gives the
configurations (`mjsense.core.lazy_dataclass`) the signature that their fields make, and shows components of the state
(`_State("text")`) as arrays. Members of a private base class in the same module are shown as those of the class."""

import ast
import copy
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|attr):`~?([\w.]+)`")

PACKAGE = Path(__file__).parents[1] / "python/mjsense"


def assigned(module: Path, name: str) -> Any:
    """What a module assigns to a name: a list or a tuple."""
    body = ast.parse(module.read_text()).body
    return next(node.value for node in body if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name)


def public(module: Path) -> set[str]:
    """The names in ``__all__``, in which ``*configs.__all__`` stands for those of another module."""
    elements = assigned(module, "__all__").elts
    others = [module.with_name(f"{one.value.value.id}.py") for one in elements if isinstance(one, ast.Starred)]
    return {one.value for one in elements if isinstance(one, ast.Constant)}.union(*map(public, others))


ROOMS = {
    name: room
    for room in reversed(ast.literal_eval(assigned(PACKAGE / "core/old_names.py", "ROOMS")))
    for name in public(PACKAGE / room.removeprefix("mjsense.") / "__init__.py") - public(PACKAGE / "__init__.py")
}
"""Modules of the public names that are not at the top of the package."""

STATES = {"_State": ("float64", "NDArray[float64]"), "Component": ("float32, on the device", "Any")}


class Docstrings(griffe.Extension):
    def on_object(self, *, obj: griffe.Object, loader: Any, **kwargs: Any) -> None:
        if isinstance(obj, griffe.Attribute) and (state := re.fullmatch(r"(_State|Component)\(['\"](.+)['\"]\)", str(obj.value))):
            about, obj.annotation = STATES[state[1]]
            obj.docstring = griffe.Docstring(f"{state[2]} Live, {about}; call `forward()` after writing.", parent=obj)
            obj.value = None
        if obj.docstring is None:
            return
        text = ROLE.sub(lambda match: reference(match[1], obj), obj.docstring.value)
        text = text.replace("``", "`")
        obj.docstring.value = re.sub(r"::$", ":", text, flags=re.MULTILINE)

    def on_package(self, *, pkg: griffe.Module, loader: Any, **kwargs: Any) -> None:
        for module in modules(pkg):
            for cls in module.classes.values():
                if cls.is_alias:
                    continue
                for base in [base for base in cls.mro() if base.parent is module and base.name[0] == "_"]:
                    for name in base.members.keys() - cls.members.keys():
                        cls.set_member(name, copy.copy(base.members[name]))
                cls.bases = [base for base in cls.bases if "._" not in getattr(base, "canonical_path", "")]  # private ones
                if any("lazy_dataclass.dataclass" in d.callable_path for d in cls.decorators):
                    parameters = [
                        griffe.Parameter(
                            f.name, annotation=f.annotation, kind=griffe.ParameterKind.positional_or_keyword, default=default(f)
                        )
                        for f in fields(cls)
                    ]
                    for name in [n for n, a in cls.attributes.items() if not a.is_alias and "ClassVar" in str(a.annotation)]:
                        cls.del_member(name)
                    own = griffe.Parameter("self", kind=griffe.ParameterKind.positional_or_keyword)
                    cls.set_member("__init__", griffe.Function("__init__", parameters=griffe.Parameters(own, *parameters)))


def modules(package: griffe.Module) -> Iterator[griffe.Module]:
    """The modules of a package and of the packages in it."""
    for module in package.modules.values():
        if not module.is_alias:
            yield module
            yield from modules(module)


def reference(name: str, obj: griffe.Object) -> str:
    """A link to the entry of `name`: a full path, a member of the same class, or a name of the package."""
    owner = obj if obj.is_class else obj.parent
    if name.startswith("mjsense"):
        path = name
    elif owner is not None and owner.is_class and name in owner.members:
        path = f"{ROOMS.get(owner.name, 'mjsense')}.{owner.name}.{name}"
    else:
        path = f"{ROOMS.get(name.partition('.')[0], 'mjsense')}.{name}"
    return f"[`{name}`][{path}]"


def fields(cls: griffe.Class) -> list[griffe.Attribute]:
    """Of a dataclass, those of its bases first; a field that is declared again keeps its place."""
    found: dict[str, griffe.Attribute] = {}
    for owner in [*reversed(cls.mro()), cls]:
        for attribute in owner.attributes.values():
            declared = not attribute.is_alias and attribute.annotation is not None and "property" not in attribute.labels
            if declared and "ClassVar" not in str(attribute.annotation):
                found[attribute.name] = attribute
    return list(found.values())


def default(attribute: griffe.Attribute) -> str | None:
    """As it is written; `field(default_factory=X)` is `X()`."""
    value = None if attribute.value is None else str(attribute.value)
    factory = re.search(r"default_factory=(.+?)\)$", value or "")
    return value if factory is None else re.sub(r"^lambda: ", "", factory[1]) + ("" if "lambda" in factory[1] else "()")
