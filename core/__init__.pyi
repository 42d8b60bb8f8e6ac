from .centreline import (
    Centreline as Centreline,
)
from .errors import (
    CameraError as CameraError,
)
from .errors import (
    ConfigError as ConfigError,
)
from .errors import (
    InputError as InputError,
)
from .errors import (
    MagbendError as MagbendError,
)
from .errors import (
    MeterError as MeterError,
)
from .errors import (
    MissingExtraError as MissingExtraError,
)
from .errors import (
    RigError as RigError,
)
from .errors import (
    SolverError as SolverError,
)
from .errors import (
    StageError as StageError,
)
from .errors import (
    StoreError as StoreError,
)
from .errors import (
    VisionError as VisionError,
)
from .jit import (
    once as once,
)
from .magnet import (
    Magnet as Magnet,
)
from .specimen import (
    Section as Section,
)
from .specimen import (
    Specimen as Specimen,
)
from .specimen_file import (
    read_magnet as read_magnet,
)
from .specimen_file import (
    read_specimen as read_specimen,
)
