"""The public functions, methods and classes of the packages, as they are once imported."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any

PACKAGES = ("solver", "ensemble", "api")


@dataclass(frozen=True)
class Documented:
    """A public function or class and what its docstring has to name.

    Attributes
    ----------
    name : str
        Dotted, with the module.
    docstring : str
    arguments : tuple of str
        Without `self` and `cls`; of a class, those of its own `__init__`.
    """

    name: str
    docstring: str
    arguments: tuple[str, ...]


def modules() -> Iterator[ModuleType]:
    """All modules of the packages, except scripts and revisions of the database's schema."""
    for package in PACKAGES:
        root = importlib.import_module(package)
        yield root
        for found in pkgutil.walk_packages(root.__path__, f"{package}."):
            if not found.name.endswith("__main__") and ".migrations" not in found.name:
                yield importlib.import_module(found.name)


def public_objects() -> Iterator[Documented]:
    """All that is public and defined in the packages, wherever it is imported, once."""
    for module in modules():
        for name, value in vars(module).items():
            if name.startswith("_") or getattr(value, "__module__", None) != module.__name__:
                continue
            if "[" in name:  # a generic model of one kind
                continue
            function = _function(value)
            if function is not None:
                yield _documented(module, name, function)
            elif inspect.isclass(value):
                yield from _of_class(module, value)


def _of_class(module: ModuleType, kind: type) -> Iterator[Documented]:
    initializer = vars(kind).get("__init__")
    # What a dataclass or a model is given are its fields, which it documents as attributes.
    written = isinstance(initializer, FunctionType) and initializer.__code__.co_filename == module.__file__
    arguments = _arguments(initializer) if written else ()
    yield Documented(f"{module.__name__}.{kind.__qualname__}", kind.__doc__ or "", arguments)
    for name, value in vars(kind).items():
        method = _function(value)
        if not name.startswith("_") and method is not None and method.__code__.co_filename == module.__file__:
            yield _documented(module, f"{kind.__qualname__}.{name}", method)


def _documented(module: ModuleType, name: str, function: FunctionType) -> Documented:
    return Documented(f"{module.__name__}.{name}", function.__doc__ or "", _arguments(function))


def _function(value: Any) -> FunctionType | None:
    """The Python function behind a function, a method or what a decorator made of either."""
    if isinstance(value, staticmethod | classmethod):
        value = value.__func__
    for attribute in ("py_func", "__wrapped__", "callback"):  # compiled, cached or wrapped functions
        inner = getattr(value, attribute, None)
        if isinstance(inner, FunctionType):
            return inner
    return value if isinstance(value, FunctionType) else None


def _arguments(function: FunctionType) -> tuple[str, ...]:
    names = tuple(inspect.signature(function).parameters)
    return names[1:] if names[:1] in (("self",), ("cls",)) else names
