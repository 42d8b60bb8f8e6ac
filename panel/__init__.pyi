from .bench.parts import (
    Twin as Twin,
)
from .demo import (
    prepare_demo as prepare_demo,
)
from .panel import (
    Panel as Panel,
)
from .server import (
    Address as Address,
)
from .server import (
    serve as serve,
)
from .workspace import (
    Workspace as Workspace,
)
