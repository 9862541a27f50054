"""Drivers and responders of a lab's own: found among what is installed, loaded when they are used.

A distribution offers them as entry points of the group `DRIVERS` or `RESPONDERS`, a name and a
factory each, which is called with settings and the clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Callable
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
        return factory  # type: ignore[no-any-return]

    def make(self, settings: object, clock: object, needed: str) -> Any:
        """Call the factory; ValueError where it fails, or makes what has no method `needed`."""
        try:
            made = self.load()(settings, clock)
        except ValueError:
            raise
        except Exception as error:
            said = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise ValueError(f"{self.name} of {self.distribution} failed: {said}") from error
        if not callable(getattr(made, needed, None)):
            raise ValueError(  # noqa: TRY004 - the fault is of the distribution, not of a caller
                f"{self.name} of {self.distribution} must make an object with {needed}(); got "
                f"{made!r}"
            )
        return made


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
            f"must be one of {names}; got {name!r}, which no installed distribution offers"
        )
    first, *others = offered[name]
    if others:
        raise ValueError(
            f"{name} is offered by {first.distribution} and by {others[0].distribution}; uninstall "
            "one of them"
        )
    return first
