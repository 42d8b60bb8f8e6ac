"""A table of options, checked by the class that stands beside a driver of others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from .errors import ConfigError


def checked_options(driver: Any, options: Mapping[str, Any], where: str) -> BaseModel:
    """Return the options as an instance of ``driver.Options``.

    Parameters
    ----------
    driver : class
        What an entry point offers.
    options : mapping
        The table as the person wrote it.
    where : str
        Its name in the file, such as ``stage.options``.

    Raises
    ------
    ConfigError
        If the class declares no pydantic model `Options`, or a key does not fit: one
        sentence that names the driver's package.
    """
    model = getattr(driver, "Options", None)
    package = str(getattr(driver, "__module__", driver)).partition(".")[0]
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        raise ConfigError(
            f"{getattr(driver, '__name__', driver)} of {package} declares no class "
            "Options (a pydantic model), so its keys cannot be checked"
        )
    try:
        return model.model_validate(dict(options))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join([where, *(str(part) for part in first["loc"])])
        raise ConfigError(f"{key}: {first['msg']} (driver of {package})") from None
