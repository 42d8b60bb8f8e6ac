from .energy import (
    energy as energy,
)
from .energy import (
    hessian as hessian,
)
from .solver import (
    CheckSolution as CheckSolution,
)
from .solver import (
    check_solve as check_solve,
)
from .solver import (
    verify as verify,
)
