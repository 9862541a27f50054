"""Drivers and responders of other distributions: listed by name, loaded when they are used.

A distribution offers them as entry points of the group `DRIVERS` or `RESPONDERS`, a name and a
factory each, which is called with settings and the clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Final

from device.errors import error_line
from device.printing import shown

if TYPE_CHECKING:
    from collections.abc import Callable
    from importlib.metadata import EntryPoint

DRIVERS: Final = "tactstrip.drivers"
RESPONDERS: Final = "tactstrip.responders"


@dataclass(frozen=True, slots=True, kw_only=True)
class Installed:
    """A factory of a driver or a responder that some distribution offers.

    Attributes
    ----------
    name : str
        Name of the driver or responder.
    distribution : str
        Name and version of the distribution.
    entry : EntryPoint
        Where the factory is.
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
                f"{error_line(error)}"
            ) from error
        if not callable(factory):
            raise ValueError(  # noqa: TRY004 - the fault is of the distribution, not of a caller
                f"{self.name} of {self.distribution} must be a factory that can be called; got "
                f"{self.entry.value}, a {type(factory).__name__}"
            )
        return factory  # type: ignore[no-any-return] # only a call can check its signature

    def make(self, settings: object, clock: object, base: type) -> Any:
        """Call the factory; ValueError if it fails, or returns no instance of the base class."""
        factory = self.load()
        try:
            made = factory(settings, clock)
            require_instance(made, base)
        except ValueError as error:
            raise ValueError(f"{self.name} of {self.distribution}: {error}") from error
        except Exception as error:
            raise ValueError(
                f"{self.name} of {self.distribution} failed: {error_line(error)}"
            ) from error
        return made


def require_instance(made: object, base: type) -> None:
    """Refuse what is no instance of a base class, by a ValueError that names the class.

    >>> require_instance(3, str)
    Traceback (most recent call last):
    ValueError: 3 must be an instance of a subclass of str
    """
    if not isinstance(made, base):
        name = f"{base.__module__.partition('.')[0]}.{base.__name__}".removeprefix("builtins.")
        raise ValueError(  # noqa: TRY004 - the fault is of who made it, not of a caller
            f"{shown(made)} must be an instance of a subclass of {name}"
        )


def installed(group: str) -> dict[str, list[Installed]]:
    """Return what is offered in a group, by name.

    >>> installed("tactstrip.nothing")
    {}
    """
    by_name: dict[str, list[Installed]] = {}
    for entry in sorted(entry_points(group=group), key=lambda entry: (entry.name, entry.value)):
        dist = entry.dist
        distribution = "unknown" if dist is None else f"{dist.name} {dist.version}"
        factories = by_name.setdefault(entry.name, [])
        if all(factory.entry != entry for factory in factories):
            factory = Installed(name=entry.name, distribution=distribution, entry=entry)
            factories.append(factory)
    return by_name


def shadowed(group: str, name: str) -> str:
    """Return a note on what is installed under the name of a built-in driver; "" if nothing is.

    >>> shadowed("tactstrip.nothing", "mock")
    ''
    """
    distributions = [factory.distribution for factory in installed(group).get(name, [])]
    if not distributions:
        return ""
    return (
        f"{name} is the built-in one; that of {', '.join(distributions)} is not used: give it "
        f"another name in its entry points, {group}"
    )


def lookup(group: str, name: str, built_in: tuple[str, ...]) -> Installed:
    """Return the entry point that a distribution installs under a name.

    An unknown name is a ValueError that lists the available ones. So is a name that two
    distributions install, because the record could not state which of them drove a session.

    >>> lookup("tactstrip.nothing", "lab", ("mock",))
    Traceback (most recent call last):
    ValueError: must be one of mock; got 'lab', which no installed distribution offers
    """
    factories = installed(group)
    if name not in factories:
        names = ", ".join(dict.fromkeys((*built_in, *factories)))
        raise ValueError(
            f"must be one of {names}; got {shown(name)}, which no installed distribution offers"
        )
    first, *more = factories[name]
    if more:
        raise ValueError(
            f"{name} is offered by {first.distribution} and by {more[0].distribution}; uninstall "
            "one of them"
        )
    return first
