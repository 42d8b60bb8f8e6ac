from .against import (
    verify as verify,
)
from .solver import (
    CheckSolution as CheckSolution,
)
from .solver import (
    check_solve as check_solve,
)
from .space import (
    SpatialCheck as SpatialCheck,
)
from .space import (
    check_spatial as check_spatial,
)
