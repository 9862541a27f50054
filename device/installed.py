"""Drivers and responders of a lab's own: found among what is installed, loaded when they are used.

A distribution offers them as entry points of the group `DRIVERS` or `RESPONDERS`, a name and a
factory each, which is called with settings and the clock.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from importlib.metadata import entry_points
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, Final

from device.printing import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from importlib.metadata import EntryPoint

DRIVERS: Final = "tactstrip.drivers"
RESPONDERS: Final = "tactstrip.responders"


@dataclass(frozen=True, slots=True, kw_only=True)
class Installed:
    """A factory that some distribution offers.

    Attributes
    ----------
    name : str
        By which it is asked for.
    distribution : str
        Which one offers it, and its version.
    entry : EntryPoint
        Where it is.
    """

    name: str
    distribution: str
    entry: EntryPoint

    def load(self) -> Callable[..., Any]:
        """Import the factory; ValueError where that fails, in one line."""
        try:
            factory = self.entry.load()
        except Exception as error:
            raise ValueError(
                f"{self.name} of {self.distribution} cannot be loaded from {self.entry.value}: "
                f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else 'no text'}"
            ) from error
        if not callable(factory):
            raise ValueError(  # noqa: TRY004 - the fault is of the distribution, not of a caller
                f"{self.name} of {self.distribution} must be a factory that can be called; got "
                f"{self.entry.value}, a {type(factory).__name__}"
            )
        return factory  # type: ignore[no-any-return] # only a call can tell more

    def make(self, settings: object, clock: object, protocol: type) -> Any:
        """Call the factory; ValueError where it fails, or makes what lacks a part of a protocol."""
        factory = self.load()
        try:
            made = factory(settings, clock)
            require_whole(made, protocol)
        except ValueError as error:
            raise ValueError(f"{self.name} of {self.distribution}: {error}") from error
        except Exception as error:
            said = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise ValueError(f"{self.name} of {self.distribution} failed: {said}") from error
        return made


_KINDS: Final[Mapping[str, tuple[str, type | tuple[type, ...]]]] = {
    "bool": ("True or False", bool),
    "str": ("a word", str),
    "int": ("a whole number", Integral),
    "float": ("a number", Real),
    "tuple[str, ...]": ("a tuple of sentences", (tuple, list)),
}
"""What may stand for a value of a protocol, by how it is declared there."""


def require_whole(made: object, protocol: type) -> None:
    """Refuse an object that lacks a part of a protocol, by a ValueError with what to add.

    >>> from typing import Protocol
    >>> class Named(Protocol):
    ...     name: str
    >>> require_whole(3, Named)
    Traceback (most recent call last):
    ValueError: int has no name: give it one, a word (see device.Named)
    """
    whose = type(made).__name__
    see = f"(see {protocol.__module__.partition('.')[0]}.{protocol.__name__})"
    for name, declared in _values(protocol):
        kind, types = _KINDS[declared]
        value = _value(made, name)
        if value is _MISSING:
            raise ValueError(f"{whose} has no {name}: give it one, {kind} {see}")
        whole = isinstance(value, types) and (types is bool or not isinstance(value, bool))
        if isinstance(value, tuple | list):
            whole = whole and all(isinstance(part, str) for part in value)
        if not whole:
            raise ValueError(f"{whose}.{name} must be {kind}; got {value!r} {see}")
    for name, function in vars(protocol).items():
        if name.startswith("_") or not inspect.isfunction(function):
            continue
        wanted = list(inspect.signature(function).parameters.values())[1:]
        listed = f"({', '.join(_listed(wanted))})"
        method = _value(made, name)
        if method is _MISSING or not callable(method):
            has = "has no method" if method is _MISSING else "must have a method"
            raise ValueError(f"{whose} {has} {name}: give it {name}{listed} {see}")
        if not _takes(method, wanted):
            raise ValueError(
                f"{whose}.{name} must take {listed}; got {inspect.signature(method)} {see}"
            )


_MISSING: Final = object()


def _values(protocol: type) -> list[tuple[str, str]]:
    """List the values that a protocol declares, and as what."""
    declared: dict[str, Any] = dict(vars(protocol).get("__annotations__", {}))
    for name, member in vars(protocol).items():
        if isinstance(member, property) and member.fget is not None:
            declared[name] = inspect.get_annotations(member.fget)["return"]
    return [(name, getattr(kind, "__name__", kind)) for name, kind in declared.items()]


def _value(made: object, name: str) -> Any:
    """Return a part of an object; ValueError where that fails."""
    try:
        return getattr(made, name, _MISSING)
    except Exception as error:
        said = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise ValueError(f"{type(made).__name__}.{name} failed: {said}") from error


def _listed(parameters: list[inspect.Parameter]) -> list[str]:
    """Return parameters as they are written, those by name behind a star."""
    names, star = [], False
    for parameter in parameters:
        if parameter.kind is parameter.KEYWORD_ONLY and not star:
            names.append("*")
            star = True
        names.append(parameter.name)
    return names


def _takes(method: Callable[..., Any], wanted: list[inspect.Parameter]) -> bool:
    """Tell whether a method can be called as the protocol's is; what cannot be told is so."""
    by_name = {p.name: None for p in wanted if p.kind is p.KEYWORD_ONLY}
    try:
        inspect.signature(method).bind(*[None] * (len(wanted) - len(by_name)), **by_name)
    except TypeError:
        return False
    except ValueError:
        return True
    return True


def installed(group: str) -> dict[str, list[Installed]]:
    """Return what is offered in a group, by name.

    >>> installed("tactstrip.nothing")
    {}
    """
    found: dict[str, list[Installed]] = {}
    for entry in sorted(entry_points(group=group), key=lambda entry: (entry.name, entry.value)):
        from_ = entry.dist
        distribution = "unknown" if from_ is None else f"{from_.name} {from_.version}"
        offered = Installed(name=entry.name, distribution=distribution, entry=entry)
        others = found.setdefault(entry.name, [])
        if all(other.entry != entry for other in others):
            others.append(offered)
    return found


def shadowed(group: str, name: str) -> str:
    """Tell of what is installed by the name of a built-in one, which is taken; else nothing.

    >>> shadowed("tactstrip.nothing", "mock")
    ''
    """
    others = [one.distribution for one in installed(group).get(name, [])]
    if not others:
        return ""
    return (
        f"{name} is the built-in one; that of {', '.join(others)} is not used: give it another "
        f"name in its entry points, {group}"
    )


def lookup(group: str, name: str, built_in: tuple[str, ...]) -> Installed:
    """Return what is offered by a name.

    ValueError with the names that there are; also where two offer it, for nobody could tell which
    of them drove a session.

    >>> lookup("tactstrip.nothing", "lab", ("mock",))
    Traceback (most recent call last):
    ValueError: must be one of mock; got 'lab', which no installed distribution offers
    """
    offered = installed(group)
    if name not in offered:
        names = ", ".join(dict.fromkeys((*built_in, *offered)))
        raise ValueError(
            f"must be one of {names}; got {shown(name)}, which no installed distribution offers"
        )
    first, *others = offered[name]
    if others:
        raise ValueError(
            f"{name} is offered by {first.distribution} and by {others[0].distribution}; uninstall "
            "one of them"
        )
    return first
