"""One family of errors: everything a user can cause or meet is a `MagbendError`.

The command line turns each of them into one sentence and exit code 1; anything else
that escapes is a defect of ours and shows a traceback.
"""

from __future__ import annotations


class MagbendError(Exception):
    """Base of all errors that carry a sentence for the user."""


class InputError(MagbendError, ValueError):
    """A value that cannot be: the message names quantity, value and unit."""


class ConfigError(InputError):
    """A file (TOML, JSON, CSV) that cannot be used: names file, key and line."""


class SolverError(MagbendError):
    """A solver that found no answer it can vouch for."""


class VisionError(MagbendError):
    """A photograph or a calibration that cannot be measured."""


class RigError(MagbendError):
    """The bench: base of everything that goes wrong with devices and runs."""


class StageError(RigError):
    """The leadscrew stage: link, alarm, limit, timeout."""


class CameraError(RigError):
    """The camera: no frame, an old frame, a broken frame."""


class MeterError(RigError):
    """The Tesla-meter: silence, garbage, overload, unknown unit."""


class StoreError(MagbendError):
    """A run folder, library or model file that is missing, torn or altered."""


def how_to_install(extra: str = "") -> str:
    """Return the command that installs magbend, or an extra of it, from its checkout.

    It is on no package index.
    """
    what = f'".[{extra}]"' if extra else "."
    return f"install it in the checkout with: pip install {what}"


class MissingExtraError(MagbendError):
    """An optional package is needed and not installed.

    Parameters
    ----------
    package : str
        What could not be imported.
    extra : str
        The extra of magbend that brings it.
    purpose : str
        What the user was about to do, as a noun: ``"the prediction library"``.
    """

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        super().__init__(
            f"{purpose} needs the package {package}, which is not installed; "
            f"{how_to_install(extra)}"
        )
